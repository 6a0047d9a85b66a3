"""Incomplete scenarios, invalid actions, damaged lakes: every environment runs or raises a clear error."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pyarrow.parquet as pq
import pytest
from gymnasium.error import ResetNeeded

from scenarionet_data.errors import BadParameter, DatabaseNotFound, LakeError, NoSuchSnapshot, ScenarioNotFound
from scenarionet_data.scenario.vocabulary import ObjectType
from scenarionet_sim.backends.bullet import Bullet
from scenarionet_sim.backends.kinematic import Kinematic
from scenarionet_sim.environments.config import BOUNDARY, PAPER_OBSERVATION
from scenarionet_sim.environments.multi_agent import ScenarioNetParallelEnv
from scenarionet_sim.environments.single_agent import ScenarioNetEnv
from scenarionet_sim.environments.vector import ScenarioNetVectorEnv
from scenarionet_sim.policies.replay import Replay
from scenarionet_sim.scenarios.selection import Scenarios
from tests.fixtures.drives import Other, make_drive
from tests.fixtures.lakes import write_lake

CROWD = tuple(
    Other(4.0 * (k % 50) - 80.0, 12.0 + 3.0 * (k // 50), vx=float(k % 7), type=ObjectType(1 + k % 3), first=k % 9)
    for k in range(499)
)
ODD = {
    "no_map": make_drive("no_map", has_map=False, others=(Other(20.0, 3.5, vx=4.0),)),
    "no_lights": make_drive("no_lights", others=(Other(20.0, 3.5, vx=4.0),)),
    "red": make_drive("red", red=True),
    "one_object": make_drive("one_object"),
    "standing": make_drive("standing", speed=0.0, others=(Other(20.0, vx=3.0),)),
    "gaps": make_drive("gaps", hidden=slice(15, 25), others=(Other(20.0, 3.5, vx=4.0, first=5, last=9),)),
    "late": make_drive("late", hidden=slice(0, 12)),
    "crowd": make_drive("crowd", others=CROWD),
}
EVERYTHING = PAPER_OBSERVATION + BOUNDARY


@pytest.fixture(scope="module")
def lake(tmp_path_factory) -> Path:
    return write_lake(tmp_path_factory.mktemp("odd"), ODD.values()).root


@pytest.mark.parametrize(
    "backend", [Kinematic(), pytest.param(Bullet(), marks=pytest.mark.integration)], ids=["kinematic", "bullet"]
)
@pytest.mark.parametrize("name", ODD)
def test_every_scenario_can_be_driven(lake, name, backend):
    env = ScenarioNetEnv(scenarios=Scenarios(lake, [f"made/v1/{name}"]), backend=backend, sensors=EVERYTHING)
    seen, _ = env.reset(seed=0)
    for _ in range(20):
        assert seen in env.observation_space
        seen, reward, terminated, truncated, _ = env.step((0.0, 0.3))
        assert np.isfinite(reward)
        if terminated or truncated:
            break
    assert (name == "standing") == terminated  # a route under 2 m counts as reached
    env.close()


@pytest.mark.parametrize("name", ODD)
def test_every_scenario_can_be_replayed_to_success(lake, name):
    env = ScenarioNetEnv(scenarios=Scenarios(lake, [f"made/v1/{name}"]), policies=(Replay(),))
    env.reset(seed=0)
    is_over = False
    while not is_over:
        _, reward, is_over, truncated, info = env.step((0.0, 0.0))
        assert np.isfinite(reward) and not truncated
    assert info["success"] and info["distance_to_log"] < 1e-5


def test_all_recordings_in_one_batch(lake):
    """Worlds of 1 to 500 objects, with and without a map, in alternation in the same slots."""
    envs = ScenarioNetVectorEnv(3, scenarios=Scenarios(lake), sensors=EVERYTHING)
    envs.reset(seed=0)
    played = set()
    for _ in range(160):
        seen, rewards, *_, info = envs.step(np.tile(np.array([0.0, 0.4], np.float32), (3, 1)))
        assert seen in envs.observation_space and np.isfinite(rewards).all()
        played |= set(info["scenario_id"])
    assert len(played) == len(ODD)


def test_five_hundred_objects_of_which_many_are_agents(lake):
    env = ScenarioNetParallelEnv(scenarios=Scenarios(lake, ["made/v1/crowd"]))
    env.reset(seed=0)
    assert len(env.possible_agents) > 100
    for _ in range(10):
        seen, *_ = env.step(dict.fromkeys(env.agents, (0.0, 0.1)))
    assert all(values in env.observation_space(agent) for agent, values in seen.items())


@pytest.mark.parametrize("action", [(np.nan, 0.0), (0.0, np.inf)])
def test_nan_action_raises_error(lake, action):
    env = ScenarioNetEnv(scenarios=Scenarios(lake, ["made/v1/red"]), backend=Kinematic())
    env.reset()
    with pytest.raises(BadParameter, match="not finite"):
        env.step(action)
    assert env.step((0.0, 0.0))[4]["timestep"] == 1  # state unchanged


@pytest.mark.parametrize(
    "backend", [Kinematic(), pytest.param(Bullet(), marks=pytest.mark.integration)], ids=["kinematic", "bullet"]
)
def test_action_out_of_range_is_clipped(lake, backend):
    results = []
    for action in ((-1.0, 1.0), (-7.0, 55.0), (-1e300, 1e300)):
        env = ScenarioNetEnv(scenarios=Scenarios(lake, ["made/v1/no_map"]), backend=backend)
        env.reset()
        results.append([env.step(action) for _ in range(3)])
    for other in results[1:]:
        np.testing.assert_equal(other, results[0])


@pytest.mark.parametrize("action", [0.0, (0.0,), (0.0, 0.0, 0.0), ((0.0, 0.0), (0.0, 0.0))])
def test_action_of_another_shape(lake, action):
    env = ScenarioNetEnv(scenarios=Scenarios(lake, ["made/v1/red"]), backend=Kinematic())
    env.reset()
    with pytest.raises(BadParameter, match=r"shape \(2,\)"):
        env.step(action)


@pytest.mark.parametrize("dt", [0.1, 0.04])
def test_scenarios_of_different_timesteps_follow_each_other(tmp_path, dt):
    """Every environment plays them at its own timestep, alone and in one batch."""
    write_lake(tmp_path, [make_drive("a"), make_drive("b", dt=0.05), make_drive("c")])
    for kind in (ScenarioNetEnv, ScenarioNetParallelEnv):
        env = kind(scenarios=Scenarios(tmp_path), backend=Kinematic(), seed=0, dt=dt)
        for _ in range(3):
            env.reset()
            env.step({"t0": (0.0, 0.0)} if kind is ScenarioNetParallelEnv else (0.0, 0.0))
            assert env.core.simulation.state.position[0, 0, 0] == pytest.approx(10.0 * dt, abs=1e-4)
    ScenarioNetVectorEnv(3, scenarios=Scenarios(tmp_path), dt=dt).reset(seed=0)


def test_step_before_reset_and_after_the_end(lake):
    env = ScenarioNetEnv(scenarios=Scenarios(lake, ["made/v1/standing"]), backend=Kinematic())
    for begin in (None, env.reset):
        if begin:
            begin()
            assert env.step((0.0, 0.0))[2]
        with pytest.raises(ResetNeeded, match="reset"):
            env.step((0.0, 0.0))
    env.reset()
    env.step((0.0, 0.0))


def test_missing_scenarios_and_timesteps(lake, tmp_path):
    with pytest.raises(NoSuchSnapshot):
        ScenarioNetEnv(scenarios=Scenarios(tmp_path))
    with pytest.raises(DatabaseNotFound, match="nowhere"):
        ScenarioNetEnv(scenarios=Scenarios(lake, "nowhere"))
    env = ScenarioNetEnv(scenarios=Scenarios(lake, ["made/v1/red"]), backend=Kinematic())
    with pytest.raises(ScenarioNotFound, match="made/v1/x"):
        env.reset(options={"scenario_id": "made/v1/x"})
    with pytest.raises(BadParameter, match="timestep 41"):
        env.reset(options={"timestep": 41})
    late = ScenarioNetEnv(scenarios=Scenarios(lake, ["made/v1/late"]), backend=Kinematic())
    with pytest.raises(BadParameter, match="timestep 3"):
        late.reset(options={"timestep": 3})


@pytest.mark.parametrize("prefetch", [0, 1])
def test_corrupt_row_group(tmp_path, prefetch):
    """The second of three scenarios cannot be read: its reset raises, and the next one continues after it."""
    lake = write_lake(tmp_path, [make_drive(name) for name in ("a", "b", "c")])
    rows = lake.resolve(["made/v1/b"])[1].to_pylist()[0]
    path = lake.root / rows["tracks_file"]
    group = pq.ParquetFile(path).metadata.row_group(rows["tracks_row_group"])
    content = bytearray(path.read_bytes())
    for number in range(group.num_columns):
        column = group.column(number)
        first = column.dictionary_page_offset or column.data_page_offset
        content[first : first + column.total_compressed_size] = b"\xff" * column.total_compressed_size
    path.chmod(0o644)
    path.write_bytes(content)
    env = ScenarioNetEnv(scenarios=Scenarios(tmp_path), backend=Kinematic(), prefetch=prefetch)
    assert env.reset(seed=0)[1]["scenario_id"] == "made/v1/a"
    with pytest.raises(LakeError, match=re.escape(str(path))):
        env.reset()
    assert env.reset()[1]["scenario_id"] == "made/v1/c"
    env.close()
