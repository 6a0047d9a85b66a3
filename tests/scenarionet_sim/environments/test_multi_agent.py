"""Every vehicle as an agent: PettingZoo's test, agents that appear and leave, and the paper's multi-agent task."""

from __future__ import annotations

import importlib
import pickle
import sys

import gymnasium
import numpy as np
import pytest
from gymnasium.error import ResetNeeded
from pettingzoo.test import parallel_api_test

from scenarionet_data.errors import BadParameter, MissingDependency
from scenarionet_sim.backends.bullet import Bullet
from scenarionet_sim.backends.kinematic import Kinematic
from scenarionet_sim.environments.multi_agent import ScenarioNetParallelEnv
from scenarionet_sim.scenarios.selection import Scenarios
from scenarionet_sim.task.scoring_kernels import TERMS
from tests.fixtures.drives import Other, make_drive
from tests.fixtures.lakes import write_lake

BACKENDS = [Kinematic(), Bullet()]


def drive(env, action=(0.0, 0.2), seed=0, **options):
    """Yield every step of an episode."""
    results = [(*env.reset(seed=seed, options=options), {})]
    while env.agents:
        before = set(env.agents)
        results.append((*env.step(dict.fromkeys(env.agents, action)), before))
    return results


@pytest.fixture
def scene(tmp_path):
    """``scene(*others)``: the scenarios of a lake with one drive among others."""
    return lambda *others, **options: Scenarios(write_lake(tmp_path, [make_drive("a", others=others, **options)]).root)


@pytest.mark.parametrize(
    "backend", [BACKENDS[0], pytest.param(BACKENDS[1], marks=pytest.mark.long)], ids=["kinematic", "bullet"]
)
@pytest.mark.parametrize("observation", ["flat", "dict"])
def test_pettingzoo_tests_pass(drives, backend, observation):
    where = "source_scenario_id IN ('crowd', 'wall')"
    env = ScenarioNetParallelEnv(scenarios=Scenarios(drives, where=where), backend=backend, observation=observation)
    parallel_api_test(env, num_cycles=200)


def test_agents_appear_as_recorded_and_leave_when_they_arrive(scene):
    """t1 is present from the start, t2 appears at timestep 15; t3 (parked) and t4 (pedestrian) are not agents."""
    walker = Other(5.0, -9.0, vy=1.0)
    env = ScenarioNetParallelEnv(
        scenarios=scene(Other(20.0, 3.5, vx=8.0), Other(-40.0, 3.5, vx=8.0, first=15), Other(90.0, 9.0))
    )
    results = drive(env)
    assert env.possible_agents == ["t0", "t1", "t2"]
    assert walker.vy == 1.0
    assert set(results[0][0]) == {"t0", "t1"}
    first_seen = next(step for step, (seen, *_) in enumerate(results) if "t2" in seen)
    assert first_seen == 15
    _, rewards, over, late, infos, acted = results[15]
    assert "t2" not in acted
    assert (rewards["t2"], over["t2"], late["t2"]) == (0.0, False, False)
    assert infos["t2"]["timestep"] == 15
    for agent in env.possible_agents:
        there = [step for step, (seen, *_) in enumerate(results) if agent in seen]
        assert there == list(range(there[0], there[-1] + 1))  # without a gap, and never again
        *_, infos, _ = results[there[-1]]
        assert infos[agent]["success"] and infos[agent]["route_completion"] > 0.95
        assert results[there[-1]][1][agent] == 10.0


def test_retired_agent_is_absent(scene):
    env = ScenarioNetParallelEnv(scenarios=scene(Other(20.0, 3.5, vx=8.0)))
    env.reset()
    while len(env.agents) == 2:
        env.step({agent: (0.0, 0.5 if agent == "t1" else -1.0) for agent in env.agents})
    assert env.agents == ["t0"]
    assert env.core.simulation.state.present[0].tolist() == [True, False]


def test_reward_matches_the_paper(scene):
    """R = R_disp + P_collision + R_term: -1 for a crash, which does not end the episode; smoothness does not count."""
    env = ScenarioNetParallelEnv(scenarios=scene(Other(8.0, vx=2.0)))
    results = drive(env, (0.0, 0.2))
    crashes = 0
    for _, rewards, over, _, infos, acted in results[1:]:
        for agent in acted:
            info = infos[agent]
            assert rewards[agent] == pytest.approx(sum(info[name] for name in TERMS), abs=1e-12)
            assert info["smoothness"] == 0.0
            assert info["collision"] in (0.0, -1.0)
            if info["collision"] and not over[agent]:
                crashes += 1
    assert crashes > 0


def test_displacement_counts_once(scene):
    env = ScenarioNetParallelEnv(scenarios=scene())
    env.reset()
    for _ in range(5):
        before = env.core.simulation.state.position[0, 0, 0]
        _, rewards, *_ = env.step({"t0": (0.0, 1.0)})
        assert rewards["t0"] == pytest.approx(env.core.simulation.state.position[0, 0, 0] - before, abs=1e-5)


def test_leaving_the_route_by_ten_metres(scene):
    env = ScenarioNetParallelEnv(scenarios=scene(num_steps=81))
    results = drive(env, (0.35, -0.2))
    *before, (_, rewards, over, _, infos, _) = results
    assert over["t0"] and infos["t0"]["out_of_road"] and rewards["t0"] == -1.0
    assert abs(infos["t0"]["lateral"]) > 10.0 >= abs(before[-1][4]["t0"]["lateral"])


def test_timesteps_without_agents_are_skipped(scene):
    """The ego arrives long before the other car comes."""
    env = ScenarioNetParallelEnv(scenarios=scene(Other(-40.0, vx=8.0, first=35), num_steps=61, speed=1.0))
    results = drive(env, (0.0, 1.0))
    arrived = next(step for step, (_, *rest) in enumerate(results) if step and rest[1].get("t0"))
    seen, rewards, over, _, infos, _ = results[arrived]
    assert infos["t0"]["timestep"] < 35 == infos["t1"]["timestep"]
    assert set(seen) == {"t0", "t1"} and env.observation_space("t1").contains(seen["t1"])
    assert rewards["t1"] == 0.0 and not over["t1"]
    assert results[arrived + 1][4]["t1"]["timestep"] == 36


def test_all_agents_run_out_of_time(scene):
    env = ScenarioNetParallelEnv(scenarios=scene(Other(30.0, 3.5, vx=8.0)))
    results = drive(env, (0.0, -1.0))
    _, _, over, late, infos, _ = results[-1]
    assert len(results) - 1 == 41 + 50
    assert all(late.values()) and not any(over.values())
    assert {info["timeout"] for info in infos.values()} == {True}
    for name in ("mean_distance_to_log", "distance_to_log", "route_completion", "cost", "mean_speed"):
        assert name in infos["t0"]
    # braking to a stop from 10 m/s at 8 m/s2 takes 6.25 m of the 40 m that were recorded
    assert infos["t0"]["distance_to_log"] == pytest.approx(40.0 - 6.25, abs=1.0)


def test_scenario_without_moving_vehicles(scene):
    env = ScenarioNetParallelEnv(scenarios=scene(speed=0.0))
    assert env.reset() == ({}, {})
    assert env.agents == env.possible_agents == []
    with pytest.raises(ResetNeeded):
        env.step({})


@pytest.mark.parametrize(
    "backend", [BACKENDS[0], pytest.param(BACKENDS[1], marks=pytest.mark.integration)], ids=["kinematic", "bullet"]
)
def test_equal_seeds_and_actions_are_bit_identical(only, backend):
    scenarios = only("crowd", "wall", order="random")
    env = ScenarioNetParallelEnv(scenarios=scenarios, backend=backend, seed=2)
    first = drive(env, (0.01, 0.3), seed=None)
    np.testing.assert_equal(drive(ScenarioNetParallelEnv(scenarios=scenarios, backend=backend), (0.01, 0.3), 2), first)
    np.testing.assert_equal(drive(pickle.loads(pickle.dumps(env)), (0.01, 0.3), seed=None), first)


def test_actions_must_match_the_agents(only):
    env = ScenarioNetParallelEnv(scenarios=only("crowd"))
    with pytest.raises(ResetNeeded):
        env.step({})
    env.reset()
    with pytest.raises(BadParameter, match="'t0'"):
        env.step(dict.fromkeys(env.agents[1:], (0.0, 0.0)))
    with pytest.raises(BadParameter, match="'nobody'"):
        env.step(dict.fromkeys([*env.agents, "nobody"], (0.0, 0.0)))
    with pytest.raises(BadParameter, match="not finite"):
        env.step(dict.fromkeys(env.agents, (np.nan, 0.0)))
    assert env.reset(options={"scenario_id": "made/v1/crowd", "timestep": 4})[1]["t0"]["timestep"] == 4
    env.close()


def test_gymnasium_says_how_to_make_it():
    with pytest.raises(BadParameter, match=r"make it with scenarionet_sim.ScenarioNetParallelEnv\(scenarios=...\)"):
        gymnasium.make("scenarionet_sim:ScenarioNet-MultiAgent-v0", scenarios=None)


def test_what_an_agent_touches_when_it_appears_is_no_crash(scene):
    """Where a parked vehicle stands: the reward counts the contact from the next step on, the crashes never do."""
    env = ScenarioNetParallelEnv(scenarios=scene(Other(-40.0, 3.5, vx=8.0, first=15), Other(-27.0, 3.5)))
    _, *later = drive(env)
    infos = [found["t1"] for *_, found, _ in later if "t1" in found]
    assert [info["collision"] for info in infos[:2]] == [0.0, -1.0]
    assert {info["vehicle_crashes"] for info in infos} == {0.0} == {info["cost"] for info in infos}


def test_missing_files_of_pettingzoo_are_said(tmp_path, monkeypatch):
    """Its import reads the files of its games, which those who make images small may have removed."""
    (tmp_path / "pettingzoo").mkdir()
    (tmp_path / "pettingzoo" / "__init__.py").write_text("open('atari/pong.py')\n")
    monkeypatch.syspath_prepend(tmp_path)
    for name in [name for name in sys.modules if name.split(".")[0] == "pettingzoo"]:
        monkeypatch.delitem(sys.modules, name)
    monkeypatch.delitem(sys.modules, ScenarioNetParallelEnv.__module__)
    with pytest.raises(MissingDependency, match=r"there is no atari/pong\.py: pip install --force-reinstall"):
        importlib.import_module(ScenarioNetParallelEnv.__module__)
