"""Flat buffers: the same episodes as the Gymnasium and PettingZoo environments, in arrays that never move."""

from __future__ import annotations

import numpy as np
import pytest
from gymnasium.vector import AutoresetMode

from scenarionet_data.errors import BadParameter, InvalidScenario
from scenarionet_sim.backends.kinematic import Kinematic
from scenarionet_sim.environments.config import EnvConfig, MultiAgentConfig, VectorConfig
from scenarionet_sim.environments.flat import FlatEnv
from scenarionet_sim.environments.multi_agent import ScenarioNetParallelEnv
from scenarionet_sim.environments.vector import ScenarioNetVectorEnv
from scenarionet_sim.policies.external import External
from scenarionet_sim.policies.objects import TrackIds
from scenarionet_sim.policies.replay import Replay
from scenarionet_sim.worlds.world import World

NAMES = ("wall", "crowd", "empty", "walker")


def test_one_agent_per_world_equals_the_vector_environment(only):
    config = VectorConfig(only(*NAMES), prefetch=0)
    flat, vector = FlatEnv(3, config), ScenarioNetVectorEnv(3, config, AutoresetMode.SAME_STEP)
    (seen, _), (expected, _) = flat.reset(seed=4), vector.reset(seed=4)
    buffers, ended = (flat.observations, flat.rewards, flat.terminals, flat.truncations), 0
    np.testing.assert_array_equal(seen, expected)
    for step in range(80):
        actions = np.stack([0.1 * np.sin(step / 5 + np.arange(3)), np.full(3, 0.5)], axis=1)
        found, wanted = flat.step(actions), vector.step(actions)
        for mine, theirs, buffer in zip(found[:4], wanted[:4], buffers, strict=True):
            np.testing.assert_array_equal(mine, theirs.astype(mine.dtype))
            assert mine is buffer
        for slot in np.flatnonzero(wanted[2] | wanted[3]):
            np.testing.assert_array_equal(flat.last_observations[slot], wanted[4]["final_obs"][slot])
        ended += len(found[4])
        assert {info["slot"] for info in found[4]} == set(np.flatnonzero(wanted[2] | wanted[3]))
    assert ended > 2 and flat.masks.all()
    flat.close()
    vector.close()


def test_several_agents_per_world_equal_the_parallel_environment(only):
    """Worlds of one scenario: every world of the batch plays what the single environment plays."""
    config = MultiAgentConfig(only("crowd"), prefetch=0)
    flat, alone = FlatEnv(2, config, seats=40), ScenarioNetParallelEnv(config)
    flat.reset(seed=0)
    observations, _ = alone.reset(seed=0)
    infos: list[dict] = []
    for step in range(150):
        row_of = _seats_by_track(flat)
        assert row_of.keys() == set(alone.agents)
        for agent, seen in observations.items():
            if agent in row_of:
                np.testing.assert_array_equal(flat.observations[row_of[agent]], seen)
        np.testing.assert_array_equal(flat.observations[:40], flat.observations[40:])
        assert flat.masks[:40].sum() == len(alone.agents)
        action = [0.02 * np.sin(step), 0.4]
        _, rewards, terminals, _, infos = flat.step(np.tile(action, (80, 1)))
        observations, single_rewards, single_terminals, _, _ = alone.step(dict.fromkeys(alone.agents, action))
        for agent, row in row_of.items():
            assert rewards[row] == np.float32(single_rewards[agent])
            assert terminals[row] == single_terminals[agent]
        if infos or not alone.agents:
            break
    assert [info["slot"] for info in infos] == [0, 1] and not alone.agents
    assert infos[0]["agents"] == len(alone.possible_agents)
    flat.close()


def test_agents_without_a_seat_have_no_row(only):
    """The first places of each world are seats; in worlds where all agents drive straight on, nothing else differs."""
    many, few = (FlatEnv(2, MultiAgentConfig(only("crowd", "wall"), prefetch=0), seats=seats) for seats in (40, 3))
    many.reset(seed=0)
    few.reset(seed=0)
    num_agents, infos = 0, []
    for _ in range(150):
        wanted = many.step(np.zeros((80, 2)))
        found = few.step(np.zeros((6, 2)))
        names = "masks", "rewards", "terminals", "truncations", "arrivals", "observations", "last_observations"
        for name in names:
            here, there = (getattr(env, name).reshape(2, env.seats, -1) for env in (few, many))
            np.testing.assert_array_equal(here, there[:, :3], name)
        np.testing.assert_array_equal(few.positions.reshape(2, 3, 2), many.positions.reshape(2, 40, 2)[:, :3])
        assert found[4] == wanted[4]
        infos += found[4]
        num_agents = max(num_agents, int(many.masks.sum()))
    assert num_agents > 10 and len(infos) > 1 and max(info["agents"] for info in infos) > 10


def test_world_without_agents_begins_the_next_scenario(only):
    """At once, without waiting for agents that never come."""
    nothing = External(TrackIds(("t99",)))
    flat = FlatEnv(2, VectorConfig(only("wall", "empty"), policies=(Replay(), nothing), prefetch=0))
    flat.reset(seed=0)
    for step in range(4):
        _, _, _, _, infos = flat.step(np.zeros((2, 2)))
        ids = [f"made/v1/{name}" for name in ("wall", "empty")]
        assert infos == [{"slot": k, "scenario_id": ids[k], "agents": 0, "success": 0.0} for k in range(2)], step
    assert not flat.masks.any()


def test_actions_are_checked(only):
    flat = FlatEnv(2, VectorConfig(only("wall")))
    flat.reset(seed=0)
    with pytest.raises(BadParameter, match=r"3 actions for 2 agents"):
        flat.step(np.zeros((3, 2)))
    with pytest.raises(BadParameter, match=r"not finite: \[0.0, nan\]"):
        flat.step([[0.0, 0.0], [0.0, np.nan]])


def _seats_by_track(flat: FlatEnv) -> dict[str, int]:
    """Track id of the agent at each seat of the first world."""
    simulation = flat._episodes.core.simulation
    track_ids, rows = simulation.batch.worlds[0].track_ids, simulation.by_place.row_at[0, : flat.seats].tolist()
    return {str(track_ids[row]): seat for seat, row in enumerate(rows) if row >= 0}


def test_what_has_no_buffers_is_refused(only):
    with pytest.raises(BadParameter, match="at least 1"):
        FlatEnv(0, VectorConfig(only("wall")))
    for config in (VectorConfig(only("wall"), observation="dict"), EnvConfig(only("wall"), (Replay(),), Kinematic())):
        with pytest.raises(BadParameter, match="flat"):
            FlatEnv(1, config)


def test_scenarios_that_cannot_be_read_are_skipped(only, monkeypatch):
    load = World.from_scenario

    def fail_for_wall(scenario, dt):
        if scenario.id.endswith("wall"):
            raise InvalidScenario(scenario.id, "tracks", "made to fail")
        return load(scenario, dt)

    monkeypatch.setattr(World, "from_scenario", fail_for_wall)
    flat = FlatEnv(3, VectorConfig(only("wall", "empty"), prefetch=0))
    flat.reset(seed=0)
    ((scenario_id, (reason, count)),) = flat.skipped.items()
    assert scenario_id.endswith("wall") and "made to fail" in reason and count == 3
    with pytest.raises(InvalidScenario):
        FlatEnv(1, VectorConfig(only("wall"), prefetch=0)).reset()
    flat.close()


def test_agents_that_waited_for_a_row_see_before_they_act(only):
    """Also when they get it in a step in which another world begins an episode."""
    flat, rng, num_waited = (
        FlatEnv(4, MultiAgentConfig(only(*NAMES, order="random")), seats=2),
        np.random.default_rng(0),
        0,
    )
    flat.reset(seed=5)
    for _ in range(200):
        before = flat.masks.copy()
        flat.step(rng.uniform([-0.3, 0.0], [0.3, 1.0], (flat.num_agents, 2)))
        np.testing.assert_array_equal(flat.observations.any(axis=1), flat.masks)
        num_waited += (flat.masks & ~before).sum()
    assert num_waited
    flat.close()


@pytest.mark.parametrize("kind", [VectorConfig, MultiAgentConfig])
def test_an_environment_goes_on_where_another_one_stood(only, kind):
    """Also in the middle of episodes that began at different times, with agents that have left."""
    config, seats = kind(only(*NAMES, order="random")), 1 if kind is VectorConfig else 30
    first, other = (FlatEnv(3, config, seats, seed, keeps_past=True) for seed in (5, 6))
    rng, results = np.random.default_rng(0), []
    first.reset()
    for _ in range(130):
        first.step(rng.uniform([-0.1, 0.0], [0.1, 1.0], (3 * seats, 2)))
    state = first.state()
    assert len(set(state.ages)) > 1 and len(state.actions) == state.ages.max()
    other.restore(state)
    for env in (first, other):
        rng = np.random.default_rng(1)
        buffers = (env.observations, env.rewards, env.terminals, env.truncations, env.masks, env.last_numbers)
        results.append([env.observations.copy(), env.masks.copy()])
        for _ in range(60):
            infos = env.step(rng.uniform([-0.1, 0.0], [0.1, 1.0], (3 * seats, 2)))[4]
            ended = env.terminals | env.truncations
            results[-1] += [values[ended] if values is env.last_numbers else values.copy() for values in buffers]
            results[-1] += [env.positions, np.array([info["success"] for info in infos])]
        env.close()
    for mine, theirs in zip(*results, strict=True):
        np.testing.assert_array_equal(theirs, mine)


def test_an_environment_without_a_past_has_no_state(only):
    env = FlatEnv(1, VectorConfig(only("empty")))
    with pytest.raises(BadParameter, match="keeps_past=True"):
        env.state()
    env.close()
