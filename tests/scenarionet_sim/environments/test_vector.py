"""The vector environment: equal to single environments, and Gymnasium's requirements of a vector environment."""

from __future__ import annotations

import copy
import pickle

import gymnasium
import numpy as np
import pytest
from gymnasium.error import ResetNeeded
from gymnasium.vector import AutoresetMode, SyncVectorEnv

from scenarionet_data.errors import BadParameter
from scenarionet_sim.backends.bullet import Bullet
from scenarionet_sim.backends.kinematic import Kinematic
from scenarionet_sim.environments.config import PAPER_OBSERVATION, VectorConfig
from scenarionet_sim.environments.outputs import ENDS
from scenarionet_sim.environments.single_agent import ScenarioNetEnv
from scenarionet_sim.environments.vector import ScenarioNetVectorEnv
from scenarionet_sim.policies.external import External
from scenarionet_sim.policies.idm import Idm
from scenarionet_sim.policies.replay import Replay
from scenarionet_sim.scenarios.sampling import Curriculum
from scenarionet_sim.scenarios.selection import Scenarios
from scenarionet_sim.sensors.bird_view import BirdView
from scenarionet_sim.task.scoring_kernels import NUMBERS
from scenarionet_sim.worlds.world import World

NAMES = ("wall", "crowd", "empty", "walker")


def actions(step, count):
    slots = np.arange(count)
    return np.stack([0.05 * np.sin(step / 3 + slots), 0.4 + 0.3 * np.cos(slots)], axis=1).astype(np.float32)


def run(envs, steps, seed=0):
    results = [envs.reset(seed=seed)]
    return results + [envs.step(actions(step, envs.num_envs)) for step in range(steps)]


@pytest.mark.parametrize("mode", [AutoresetMode.NEXT_STEP, AutoresetMode.SAME_STEP])
@pytest.mark.parametrize(
    ("backend", "exact"),
    [(Kinematic(), True), pytest.param(Bullet(), False, marks=pytest.mark.integration)],
    ids=["kinematic", "bullet"],
)
def test_batch_equals_its_worlds_one_by_one(only, mode, backend, exact):
    """Each slot of Gymnasium's own vector environment gets the scenario that the batch draws for it."""
    count, steps = 4, 60
    batch = ScenarioNetVectorEnv(count, scenarios=only(*NAMES), backend=backend, autoreset_mode=mode)
    single = SyncVectorEnv(
        [lambda name=name: ScenarioNetEnv(scenarios=only(name), backend=backend) for name in NAMES], autoreset_mode=mode
    )
    (seen, _), (expected, _) = batch.reset(seed=0), single.reset(seed=0)
    np.testing.assert_allclose(seen, expected, atol=0 if exact else 1e-5)
    running = np.ones(count, np.bool_)  # from its second episode on, a slot of the batch has another scenario
    for step in range(steps):
        one, other = batch.step(actions(step, count)), single.step(actions(step, count))
        ended = other[2] | other[3]
        for mine, theirs in zip(one[1:4], other[1:4], strict=True):
            np.testing.assert_allclose(mine[running], theirs[running], atol=1e-12 if exact else 1e-4)
        still = running & ~ended if mode is AutoresetMode.SAME_STEP else running
        np.testing.assert_allclose(one[0][still], other[0][still], atol=0 if exact else 1e-4)
        for slot in np.flatnonzero(running & ended) if mode is AutoresetMode.SAME_STEP else ():
            np.testing.assert_allclose(
                one[4]["final_obs"][slot], other[4]["final_obs"][slot], atol=0 if exact else 1e-4
            )
            assert one[4]["final_info"]["scenario_id"][slot] == other[4]["final_info"]["scenario_id"][slot]
        running &= ~ended
    assert running.sum() < count


@pytest.mark.parametrize(
    "backend", [Kinematic(), pytest.param(Bullet(), marks=pytest.mark.integration)], ids=["kinematic", "bullet"]
)
@pytest.mark.parametrize("observation", ["flat", "dict"])
def test_equal_seeds_and_actions_are_bit_identical(drives, backend, observation):
    made = [
        ScenarioNetVectorEnv(5, scenarios=Scenarios(drives, order="random"), backend=backend, observation=observation)
        for _ in range(2)
    ]
    for one, other in zip(*(run(envs, 70, seed=4) for envs in made), strict=True):
        np.testing.assert_equal(one, other)


def test_consecutive_scenarios_in_a_slot(only):
    envs = ScenarioNetVectorEnv(2, scenarios=only("wall", "crowd", "empty"))
    results = run(envs, 120)
    ids = np.array([result[-1]["scenario_id"] for result in results]).T
    assert ids[:, 0].tolist() == ["made/v1/wall", "made/v1/crowd"]
    for slot in ids:
        assert len(set(slot)) > 1
    assert set(ids.ravel()) == {"made/v1/wall", "made/v1/crowd", "made/v1/empty"}


def test_step_after_an_end_begins_the_next_episode(only):
    envs = ScenarioNetVectorEnv(3, scenarios=only("empty", "crowd"))
    results = run(envs, 100)
    ended = np.zeros(3, np.bool_)
    for _, rewards, terminated, truncated, info in results[1:]:
        assert (rewards[ended] == 0.0).all()
        assert not (terminated | truncated)[ended].any()
        assert (info["timestep"][ended] == 0).all()
        assert (info["timestep"][~ended] > 0).all()
        ended = terminated | truncated
    assert any((result[2] | result[3]).any() for result in results[1:])


def test_infos_are_arrays_with_masks(only):
    envs = ScenarioNetVectorEnv(3, scenarios=only("empty"), autoreset_mode="SameStep")
    results = run(envs, 60)
    for _, *_, info in results:
        for name in (*NUMBERS, *ENDS, "timestep", "scenario_id"):
            assert info[name].shape == (3,)
            assert info[f"_{name}"].all()
    last = next(info for *_, info in results if "final_info" in info)
    ended = last["_final_info"]
    assert last["final_info"]["success"][ended].all()
    assert (last["final_info"]["_success"] == ended).all()
    assert all(seen in envs.single_observation_space for seen in last["final_obs"][ended])
    assert all(seen is None for seen in last["final_obs"][~ended])


@pytest.mark.parametrize("mode", [AutoresetMode.NEXT_STEP, AutoresetMode.SAME_STEP])
@pytest.mark.parametrize("observation", ["flat", "dict"])
def test_what_is_kept_of_a_step_does_not_change(only, mode, observation):
    """Arrays are used again only if nothing refers to them, to a part of them, or to an info."""
    sensors = (*PAPER_OBSERVATION, BirdView(16, 32.0))
    envs = ScenarioNetVectorEnv(
        3, scenarios=only(*NAMES), observation=observation, sensors=sensors, autoreset_mode=mode
    )
    rng, kept = np.random.default_rng(0), []
    result = envs.reset(seed=0)
    for step in range(80):
        arrays = _arrays(result)
        chosen = [arrays[name] for name in rng.choice(sorted(arrays), 2)]
        kept += [(values, copy.deepcopy(values)) for values in (chosen if step % 3 else [v[1:] for v in chosen])]
        result = envs.step(actions(step, 3))
    for values, expected in kept:
        np.testing.assert_equal(values, expected)


def _arrays(result):
    """All arrays that a step or a reset returned, by a name."""
    found = {}
    for number, part in enumerate(result):
        parts = part if isinstance(part, dict) else {"": part}
        found |= {
            f"{number} {name}": values for name, values in parts.items() if name not in ("final_obs", "final_info")
        }
    return found


def test_arrays_that_nothing_refers_to_are_used_again(only):
    envs = ScenarioNetVectorEnv(3, scenarios=only(*NAMES))
    envs.reset(seed=0)
    places = set()
    for step in range(60):
        observed = envs.step(actions(step, 3))[0]
        places.add(observed.__array_interface__["data"][0])
    assert len(places) <= 3


def test_results_do_not_depend_on_which_worlds_are_stored(only):
    """A world that was dropped meanwhile is loaded again, and its place in the pool is another one."""
    configs = [{"cache_size": 32}, {"cache_size": 1, "prefetch": 0}, {"cache_size": 2, "prefetch": 3}]
    wanted = None
    for config in configs:
        envs = ScenarioNetVectorEnv(2, scenarios=only(*NAMES, "cone", "parked", order="random"), **config)
        found = run(envs, 200, seed=3)
        assert len(envs.core.simulation.batch.pool) <= min(2 + config["cache_size"], 6)
        wanted = wanted or found
        np.testing.assert_equal(found, wanted)
        envs.close()


def test_invalid_actions_do_not_skip_a_scenario(only):
    """The episodes that begin with a step begin with the next valid one."""
    envs, other = (ScenarioNetVectorEnv(2, scenarios=only("wall", "empty", "crowd")) for _ in range(2))
    envs.reset(seed=0)
    other.reset(seed=0)
    for step in range(70):
        with pytest.raises(BadParameter, match="not finite"):
            envs.step(np.full((2, 2), np.nan))
        np.testing.assert_equal(envs.step(actions(step, 2)), other.step(actions(step, 2)))


@pytest.mark.parametrize("prefetch", [0, 1])
def test_slots_of_one_scenario_share_its_world(only, monkeypatch, prefetch):
    """Also if more scenarios are played than are kept otherwise."""
    loaded = []
    load = World.from_scenario
    monkeypatch.setattr(World, "from_scenario", lambda scenario, dt: loaded.append(scenario.id) or load(scenario, dt))
    envs = ScenarioNetVectorEnv(12, scenarios=only("wall", "empty", "crowd"), cache_size=1, prefetch=prefetch)
    run(envs, 100)
    assert len(envs.core.simulation.batch.pool) == 3
    assert len({id(world) for world in envs.core.simulation.batch.worlds}) <= 3
    assert prefetch or len(loaded) == 3
    run(envs, 100)
    assert len(envs.core.simulation.batch.pool) == 3
    envs.close()


def test_gymnasium_makes_it(only):
    envs = gymnasium.make_vec(
        "ScenarioNet-v0", 3, scenarios=only("wall", "empty"), policies=(Replay(), Idm(), External())
    )
    assert isinstance(envs.unwrapped, ScenarioNetVectorEnv)
    assert envs.metadata["autoreset_mode"] is AutoresetMode.NEXT_STEP
    assert envs.unwrapped.config.backend == Kinematic()
    recorded = gymnasium.wrappers.vector.RecordEpisodeStatistics(envs)
    recorded.reset(seed=1)
    for step in range(50):
        seen, *_, info = recorded.step(actions(step, 3))
        assert seen in envs.observation_space
    assert "episode" in info or recorded.episode_count > 0


def test_renders_every_world(only):
    envs = gymnasium.make_vec("ScenarioNet-v0", 2, scenarios=only("crowd", "wall"), render_mode="rgb_array")
    with pytest.raises(ResetNeeded):
        envs.render()
    envs.reset(seed=0)
    crowd, wall = envs.render()
    assert crowd.shape == wall.shape == (800, 800, 3) and crowd.dtype == np.uint8 and (crowd != wall).any()
    envs.step(np.zeros((2, 2)))
    assert (envs.render()[0] != crowd).any()
    assert pickle.loads(pickle.dumps(envs)).render_mode == envs.render_mode == "rgb_array"
    envs.close()
    with pytest.raises(BadParameter, match=r"render_mode='human' of 2 worlds; expected 'rgb_array'"):
        ScenarioNetVectorEnv(2, scenarios=only("wall"), render_mode="human")


def test_vector_environment_is_picklable(only):
    envs = ScenarioNetVectorEnv(2, VectorConfig(only("wall", "empty", "crowd", order="random")), seed=9)
    results = run(envs, 30, seed=None)
    copy = pickle.loads(pickle.dumps(envs))
    for one, other in zip(results, run(copy, 30, seed=None), strict=True):
        np.testing.assert_equal(one, other)


def test_curriculum_advances_with_all_worlds(only):
    course = Curriculum(levels=2, episodes=4, by="scenario_id = 'made/v1/empty'")
    envs = ScenarioNetVectorEnv(4, scenarios=only("crowd", "empty", curriculum=course), policies=(Replay(),))
    results = run(envs, 150)
    ids = [set(result[-1]["scenario_id"]) for result in results]
    assert ids[0] == {"made/v1/crowd"}
    assert ids[-1] == {"made/v1/empty"}


def test_invalid_calls_are_rejected(only):
    with pytest.raises(BadParameter, match="num_envs=0"):
        ScenarioNetVectorEnv(0, scenarios=only("wall"))
    with pytest.raises(BadParameter, match="NEXT_STEP or SAME_STEP"):
        ScenarioNetVectorEnv(1, scenarios=only("wall"), autoreset_mode=AutoresetMode.DISABLED)
    envs = ScenarioNetVectorEnv(2, scenarios=only("wall"))
    with pytest.raises(ResetNeeded):
        envs.step(np.zeros((2, 2)))
    envs.reset()
    with pytest.raises(BadParameter, match="not finite"):
        envs.step(np.array([[0.0, 0.0], [np.nan, 0.0]]))
    with pytest.raises(BadParameter, match="1 actions for 2 agents"):
        envs.step(np.zeros((1, 2)))
    envs.close()
