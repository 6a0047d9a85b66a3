"""The single-agent environment: the paper's task end to end, and Gymnasium's requirements."""

from __future__ import annotations

import pickle
import sys
from dataclasses import replace

import gymnasium
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env

from scenarionet_data.errors import BadParameter
from scenarionet_sim.backends.bullet import Bullet
from scenarionet_sim.backends.kinematic import Kinematic
from scenarionet_sim.environments.config import BOUNDARY, PAPER_OBSERVATION, EnvConfig
from scenarionet_sim.environments.observation import Observation
from scenarionet_sim.environments.outputs import ENDS
from scenarionet_sim.environments.single_agent import ScenarioNetEnv
from scenarionet_sim.policies.external import External
from scenarionet_sim.policies.idm import Idm
from scenarionet_sim.policies.objects import ego
from scenarionet_sim.policies.replay import Replay
from scenarionet_sim.scenarios.selection import Scenarios
from scenarionet_sim.sensors.lidar import Lidar
from scenarionet_sim.task.scoring_kernels import NUMBERS, TERMS
from scenarionet_sim.task.task import Termination

GO, COAST, LEFT = (0.0, 0.6), (0.0, 0.0), (1.0, 0.3)
BACKENDS = [Kinematic(), Bullet()]


def rollout(env, action=GO, seed=None, steps=1000, **options):
    """Yield every step of an episode."""
    observation, info = env.reset(seed=seed, options=options)
    results = [(observation, 0.0, False, False, info)]
    while not (results[-1][2] or results[-1][3]) and len(results) <= steps:
        results.append(env.step(action(len(results)) if callable(action) else action))
    return results


def wander(step):
    return 0.05 * np.sin(step / 3), 0.3 * np.cos(step / 7)


def assert_same(first, second):
    """Compare bit for bit."""
    assert len(first) == len(second)
    for (one, *rest), (other, *others) in zip(first, second, strict=True):
        np.testing.assert_array_equal(one, other)
        assert rest == others


@pytest.mark.parametrize("backend", BACKENDS, ids=repr)
@pytest.mark.parametrize("observation", ["flat", "dict"])
def test_gymnasium_checker_passes(only, backend, observation):
    env = gymnasium.make("ScenarioNet-v0", scenarios=only("crowd", "wall"), backend=backend, observation=observation)
    check_env(env.unwrapped, skip_render_check=True)
    assert env.spec.id == "ScenarioNet-v0"


def test_gymnasium_checker_renders_without_a_display(only, monkeypatch):
    """Without arguments: it makes the environment again in every render mode that its metadata list."""
    monkeypatch.delenv("DISPLAY", raising=False)
    monkeypatch.delenv("WAYLAND_DISPLAY", raising=False)
    env = gymnasium.make("ScenarioNet-v0", scenarios=only("wall"), backend=Kinematic())
    check_env(env.unwrapped)
    assert env.metadata["render_modes"] == (["rgb_array"] if sys.platform == "linux" else ["rgb_array", "human"])
    assert ScenarioNetEnv.metadata["render_modes"] == ["rgb_array", "human"]


def test_default_matches_the_paper(only):
    env = ScenarioNetEnv(scenarios=only("wall"))
    assert isinstance(env.config.backend, Kinematic)
    assert env.action_space.shape == (2,)
    assert env.observation_space.shape == (120 + 7 + 10 * 2,)
    with_boundary = ScenarioNetEnv(scenarios=only("wall"), sensors=PAPER_OBSERVATION + BOUNDARY)
    assert with_boundary.observation_space.shape == (120 + 7 + 10 * 2 + 12,)


def test_observations_match_the_sensors(only):
    flat = ScenarioNetEnv(scenarios=only("wall"), backend=Kinematic())
    named = ScenarioNetEnv(scenarios=only("wall"), backend=Kinematic(), observation="dict")
    for (one, *_), (other, *_) in zip(rollout(flat), rollout(named), strict=True):
        parts = Observation(flat.config.sensors, "flat").parts(one)
        assert list(parts) == list(other) == ["lidar", "ego_state", "navigation"]
        for name, values in other.items():
            np.testing.assert_array_equal(parts[name], values)
            assert values in named.observation_space[name]
    lidar = rollout(named, steps=0)[0][0]["lidar"]
    assert lidar[0] == pytest.approx((25.0 - 2.3) / 50.0, abs=1e-6)  # the rear of the car ahead


@pytest.mark.parametrize("backend", BACKENDS, ids=repr)
def test_reward_of_every_step(only, backend):
    """On a straight road along x, progress is the difference of x."""
    env = ScenarioNetEnv(scenarios=only("empty"), backend=backend)
    env.reset()
    x = 0.0
    for step in range(1000):
        steering = 0.02 * (-1) ** step
        _, reward, terminated, truncated, info = env.step((steering, 0.5))
        state = env.core.simulation.state
        assert reward == pytest.approx(sum(info[name] for name in TERMS), abs=1e-12)
        progress, x = state.position[0, 0, 0] - x, state.position[0, 0, 0]
        speed = np.hypot(*state.velocity[0, 0])
        assert info["smoothness"] == pytest.approx(min(0.0, 1.0 / speed - abs(steering)), abs=1e-9)
        if terminated:
            break
        assert info["displacement"] == pytest.approx(2.0 * progress, abs=1e-5)
        assert info["terminal"] == info["collision"] == 0.0
        assert info["route_completion"] == pytest.approx(x / 40.0, abs=1e-6)
    assert (info["terminal"], info["displacement"], truncated) == (10.0, 0.0, False)
    assert info["success"] and not info["out_of_road"] and not info["timeout"]
    assert x > 0.95 * 40.0


@pytest.mark.parametrize("backend", BACKENDS, ids=repr)
def test_leaving_the_route(only, backend):
    env = ScenarioNetEnv(scenarios=only("empty"), backend=backend)
    *before, (_, reward, terminated, truncated, info) = rollout(env, LEFT)
    assert (terminated, truncated, info["out_of_road"], info["success"]) == (True, False, True, False)
    assert (info["terminal"], info["displacement"]) == (-5.0, 0.0)
    assert reward == -5.0 + info["smoothness"]
    assert info["lateral"] > 2.5 >= before[-1][4]["lateral"]


def test_running_out_of_time(only):
    """The recording has 41 timesteps; 50 more are allowed."""
    env = ScenarioNetEnv(scenarios=only("empty"), backend=Kinematic())
    results = rollout(env, (0.0, -1.0))
    _, reward, terminated, truncated, info = results[-1]
    assert (len(results) - 1, terminated, truncated, info["timeout"], reward) == (41 + 50, False, True, True, 0.0)
    shorter = ScenarioNetEnv(scenarios=only("empty"), backend=Kinematic(), termination=Termination(extra_steps=0))
    assert len(rollout(shorter, (0.0, -1.0))) - 1 == 41


@pytest.mark.parametrize(
    ("name", "penalty", "kind"),
    [("wall", -2.0, "vehicle"), ("walker", -2.0, "human"), ("cone", -0.5, "object")],
)
def test_collisions_cost_while_they_last_and_do_not_end_the_episode(only, name, penalty, kind):
    env = ScenarioNetEnv(scenarios=only(name), backend=Kinematic())
    results = rollout(env, COAST if name == "walker" else GO)
    touching = [info["collision"] != 0.0 for *_, info in results]
    assert {info["collision"] for *_, info in results} == {0.0, penalty}
    assert sum(touching) > 1
    assert sum(info.get("cost", 0.0) for *_, info in results) == 1.0  # one crash, however long it lasts
    assert results[-1][4][f"{kind}_crashes"] == 1.0
    assert not any(terminated for _, _, terminated, *_ in results[: touching.index(True) + 1])


@pytest.mark.parametrize("backend", BACKENDS, ids=repr)
@pytest.mark.parametrize("policies", [(Replay(),), (Replay(), Idm(objects=ego))], ids=["replay", "idm"])
def test_ego_driven_by_a_policy_arrives(only, backend, policies):
    env = ScenarioNetEnv(scenarios=only("crowd", "empty"), backend=backend, policies=policies)
    for _ in range(2):
        *_, (_, reward, terminated, _, info) = rollout(env, LEFT)  # the action is ignored
        assert terminated and info["success"]
        assert reward == 10.0
    # IDM brakes at 3 m/s² to stop at the end: when the log gets there at 10 m/s, it drives 5 m/s, 5²/(2 · 3) m before
    late = 0.0 if len(policies) == 1 else 25.0 / 6.0
    assert info["distance_to_log"] == pytest.approx(late, abs=1e-5 if len(policies) == 1 else 0.01)


def test_idm_ego_stops_where_the_road_is_blocked(only):
    env = ScenarioNetEnv(scenarios=only("wall"), policies=(Replay(), Idm(objects=ego)))
    *_, (_, _, _, truncated, info) = rollout(env)
    assert truncated and info["vehicle_crashes"] == 0.0
    assert env.core.simulation.state.position[0, 0, 0] < 25.0 - 4.6


def test_ego_driven_by_a_policy_observes_like_an_agent(only):
    watched = ScenarioNetEnv(scenarios=only("crowd"), policies=(Replay(),))
    driving = ScenarioNetEnv(scenarios=only("crowd"), backend=Kinematic())
    np.testing.assert_array_equal(watched.reset()[0], driving.reset()[0])
    # the ego keeps its recorded 10 m/s without throttle
    for one, other in zip(rollout(watched, COAST), rollout(driving, COAST), strict=True):
        np.testing.assert_allclose(one[0], other[0], atol=1e-5)
        assert one[1] == pytest.approx(other[1], abs=1e-5)


@pytest.mark.parametrize("backend", BACKENDS, ids=repr)
def test_equal_seeds_and_actions_are_bit_identical(only, backend):
    noisy = (Lidar(rays=30, noise=0.5, dropout=0.1), *PAPER_OBSERVATION[1:])
    config = EnvConfig(only("crowd", "wall", "walker", "cone", order="random"), backend=backend, sensors=noisy)
    first, other = ScenarioNetEnv(config), ScenarioNetEnv(config)
    for seed in (3, None, None, 3):
        assert_same(rollout(first, wander, seed), rollout(other, wander, seed))
    again = rollout(first, wander, 3)
    assert_same(again, rollout(other, wander, 3))
    different = rollout(other, wander, 4)
    assert not np.array_equal(different[0][0], again[0][0])


def test_environments_of_one_process_are_independent(only):
    alone = rollout(ScenarioNetEnv(scenarios=only("crowd")), wander, seed=0)
    pair = [ScenarioNetEnv(scenarios=only("crowd")) for _ in range(2)]
    for env in pair:
        env.reset(seed=0)
    together = [[env.step(wander(step)) for env in pair] for step in range(1, len(alone))]
    for one, (first, second) in zip(alone[1:], together, strict=True):
        assert_same([one, one], [first, second])


def test_environment_is_pickled_as_configuration_and_seed(only):
    env = ScenarioNetEnv(scenarios=only("wall", "crowd", "cone", order="random"), backend=Kinematic(), seed=11)
    first = [rollout(env, wander) for _ in range(3)]
    copy = pickle.loads(pickle.dumps(env))
    assert copy.config == env.config
    for episode in first:
        assert_same(rollout(copy, wander), episode)
    assert len(pickle.dumps(env)) < 3_000


def test_scenarios_by_order_and_by_id(only):
    env = ScenarioNetEnv(scenarios=only("wall", "cone", "empty"), backend=Kinematic(), seed=0)
    played = [env.reset()[1]["scenario_id"].rpartition("/")[2] for _ in range(4)]
    assert played == ["wall", "cone", "empty", "wall"]
    assert env.reset(seed=0)[1]["scenario_id"] == "made/v1/wall"
    assert env.reset(options={"scenario_id": "made/v1/empty", "timestep": 7})[1]["timestep"] == 7
    assert env.core.simulation.state.position[0, 0, 0] == pytest.approx(7.0, abs=1e-4)
    assert env.reset()[1]["scenario_id"] == "made/v1/cone"


def test_closed_environment_can_be_reset(only):
    env = ScenarioNetEnv(scenarios=only("crowd"))
    first = rollout(env, wander, seed=1)
    env.close()
    env.close()
    assert_same(rollout(env, wander, seed=1), first)


def test_info_is_complete(only):
    info = rollout(ScenarioNetEnv(scenarios=only("wall"), backend=Kinematic()))[-1][4]
    assert set(info) == {*NUMBERS, *ENDS, "timestep", "scenario_id"}
    assert all(type(info[name]) is float for name in NUMBERS)
    assert all(type(info[name]) is bool for name in ENDS)


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({}, "needs scenarios"),
        ({"scenario": 1}, "needs scenarios"),
        ({"scenarios": "lake"}, "expected Scenarios"),
        ({"scenarios": Scenarios("lake"), "observation": "list"}, "'flat' or 'dict'"),
        ({"scenarios": Scenarios("lake"), "sensors": ()}, "at least one"),
        ({"scenarios": Scenarios("lake"), "render_mode": "ansi"}, "rgb_array"),
    ],
)
def test_invalid_settings(settings, message):
    with pytest.raises(BadParameter, match=message):
        ScenarioNetEnv(**settings)


def test_unknown_setting_is_a_type_error():
    with pytest.raises(TypeError, match="unknown setting 'backends'"):
        ScenarioNetEnv(scenarios=Scenarios("lake"), backends=1)


def test_configuration_object_or_its_fields(only):
    config = EnvConfig(only("wall"), backend=Kinematic())
    assert ScenarioNetEnv(config).config == config
    assert replace(config, cache_size=2) != config
    with pytest.raises(BadParameter, match="not both"):
        ScenarioNetEnv(config, cache_size=2)
    with pytest.raises(BadParameter, match="ego alone"):
        ScenarioNetEnv(
            scenarios=only("crowd"), policies=(External(objects=lambda world: world.object_type == 1),)
        ).reset()


@pytest.mark.long
def test_rendered_frames(only):
    env = ScenarioNetEnv(scenarios=only("wall", "cone"), backend=Kinematic(), render_mode="rgb_array")
    env.reset()
    first = env.render()
    env.step(GO)
    second = env.render()
    assert first.shape == second.shape == (800, 800, 3) and first.dtype == np.uint8
    assert (first != second).any()
    assert len(np.unique(first.reshape(-1, 3), axis=0)) > 5
    with pytest.warns(UserWarning, match="render_mode"):
        silent = ScenarioNetEnv(scenarios=only("wall"), backend=Kinematic())
        silent.reset()
        assert silent.render() is None
