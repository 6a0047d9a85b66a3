"""Observations along the log: one per vehicle and recorded timestep, as in an environment."""

from __future__ import annotations

import numpy as np
import pytest

from scenarionet_data.errors import BadParameter
from scenarionet_data.scenario.vocabulary import ObjectType
from scenarionet_sim.environments.config import PAPER_OBSERVATION, EnvConfig
from scenarionet_sim.environments.single_agent import ScenarioNetEnv
from scenarionet_sim.evaluation import recording as recordings_module
from scenarionet_sim.evaluation.recording import record
from scenarionet_sim.policies.replay import Replay
from scenarionet_sim.scenarios.selection import Scenarios
from scenarionet_sim.sensors.camera import Camera
from scenarionet_sim.simulation.simulation import Simulation
from scenarionet_sim.worlds.world import World
from tests.fixtures.drives import Other, make_drive
from tests.fixtures.lakes import write_lake

OTHERS = Other(20.0, y=3.5, vx=5.0, first=3, last=9), Other(12.0, y=-3.0, type=ObjectType.PEDESTRIAN)
SCENARIOS = [make_drive(f"d{k}", num_steps=21, speed=8.0 + k, others=OTHERS) for k in range(3)]


@pytest.fixture
def lake(tmp_path, monkeypatch):
    monkeypatch.setattr(recordings_module, "PART_SIZE", 2)
    recordings_module._loader.cache_clear()
    return write_lake(tmp_path / "lake", SCENARIOS)


def test_one_row_per_vehicle_and_timestep(lake):
    assert record(lake, name="seen") == 0
    counts = lake.sql(
        "SELECT scenario_id, track_id, count(*), min(timestep), max(timestep) FROM observations GROUP BY ALL"
    )
    expected = {(s.id, track, *span) for s in SCENARIOS for track, span in (("t0", (21, 0, 20)), ("t1", (7, 3, 9)))}
    assert set(counts.rows()) == expected
    length = sum(int(np.prod(sensor.shape)) for sensor in PAPER_OBSERVATION)
    assert lake.sql("SELECT DISTINCT len(observation) FROM observations").item() == length


def test_ego_observes_the_same_as_in_the_environment(lake):
    record(lake, name="seen", agents="ego")
    seen = lake.sql(
        "SELECT observation FROM observations WHERE scenario_id = $id ORDER BY timestep", {"id": SCENARIOS[0].id}
    )
    config = EnvConfig(Scenarios(lake.root), policies=(Replay(),), prefetch=0)
    environment = ScenarioNetEnv(config)
    found = [environment.reset(seed=0, options={"scenario_id": SCENARIOS[0].id})[0]]
    for _ in range(15):
        found.append(environment.step([0.0, 0.0])[0])
    environment.close()
    np.testing.assert_allclose(np.array(seen["observation"].to_list())[:16], np.array(found), atol=1e-6)


def test_second_call_continues_the_run(lake):
    record(str(lake.root), name="seen")
    lake.files.path("results/seen/observations/000001.parquet").unlink()
    assert record(lake, name="seen") == 2
    assert lake.sql("SELECT count(DISTINCT scenario_id) FROM observations").item() == 3


def test_unknown_agents_are_refused(lake):
    with pytest.raises(BadParameter, match="unknown agents 'birds'; choose from vehicles, ego"):
        record(lake, name="seen", agents="birds")


@pytest.mark.long  # compiles the camera
def test_frames_are_those_of_the_camera(lake):
    camera = Camera(24, 16, channels=("rgb", "depth"), has_scenery=False)
    record(lake, name="seen", agents="ego", cameras=(camera,))
    rows = lake.sql("SELECT * FROM frames WHERE scenario_id = $id AND timestep = 0", {"id": SCENARIOS[0].id})
    simulation = Simulation([World.from_scenario(SCENARIOS[0])], (Replay(),))
    simulation.reset(0, start=0)
    expected = camera.frames(simulation.batch, simulation.state, np.array([[0, 0]], np.int32))
    assert set(rows["channel"]) == {"rgb", "depth"}
    for row in rows.rows(named=True):
        picture = expected[row["channel"]][0]
        assert (row["height"], row["width"]) == (16, 24)
        found = np.frombuffer(row["pixels"], row["dtype"]).reshape(picture.shape)
        np.testing.assert_array_equal(found, picture)
    assert lake.sql("SELECT count(*) FROM frames").item() == 3 * 21 * 2
