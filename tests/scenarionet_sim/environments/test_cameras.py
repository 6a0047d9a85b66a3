"""Cameras in every kind of environment, and in evaluation."""

from __future__ import annotations

import gymnasium
import numpy as np
import pytest

from scenarionet_sim.environments.multi_agent import ScenarioNetParallelEnv
from scenarionet_sim.environments.single_agent import ScenarioNetEnv
from scenarionet_sim.environments.vector import ScenarioNetVectorEnv
from scenarionet_sim.evaluation.evaluation import evaluate
from scenarionet_sim.scenarios.selection import Scenarios
from scenarionet_sim.sensors.camera import Camera
from tests.fixtures.drives import Other, make_drive
from tests.fixtures.lakes import write_lake

pytestmark = pytest.mark.long  # compiles the camera

CAMERA = Camera(24, 16, has_scenery=False)
OPTIONS = {"sensors": (CAMERA,), "observation": "dict"}


@pytest.fixture(scope="module")
def lake(tmp_path_factory):
    return write_lake(tmp_path_factory.mktemp("cameras"), [make_drive("a", others=(Other(20.0, 3.5, vx=8.0),))])


def check(pictures, space):
    assert space["camera"] == gymnasium.spaces.Box(0, 255, (16, 24, 3), np.uint8)
    for picture in pictures:
        assert picture.shape == (16, 24, 3)
        assert picture.dtype == np.uint8
        assert picture.std() > 5


def test_single_vector_and_multi_agent_environments_see_the_same(lake):
    scenarios = Scenarios(lake.root)
    single = ScenarioNetEnv(scenarios=scenarios, **OPTIONS)
    vector = ScenarioNetVectorEnv(2, scenarios=scenarios, **OPTIONS)
    parallel = ScenarioNetParallelEnv(scenarios=scenarios, **OPTIONS)
    seen, _ = single.reset(seed=0)
    batch, _ = vector.reset(seed=0)
    agents, _ = parallel.reset(seed=0)
    check([seen["camera"], *batch["camera"]], single.observation_space)
    check([each["camera"] for each in agents.values()], parallel.observation_space("t0"))
    np.testing.assert_array_equal(batch["camera"][1], seen["camera"])
    np.testing.assert_array_equal(agents["t0"]["camera"], seen["camera"])
    assert (agents["t1"]["camera"] != seen["camera"]).any()
    moved = single.step(np.array([0.0, 1.0], np.float32))[0]["camera"]
    assert (moved != seen["camera"]).any()
    for environment in (single, vector, parallel):
        environment.close()


class Watcher:
    """Brakes when its picture is dark."""

    sensors = (CAMERA,)

    def act(self, observation: np.ndarray) -> list[float]:
        assert observation.shape == (16 * 24 * 3,)
        return [0.0, 1.0 if observation.mean() > 20 else -1.0]


def test_drivers_are_evaluated_on_pictures(lake):
    evaluate(lake, policy=f"{__name__}:Watcher", name="watched")
    assert lake.sql("SELECT count(*) FROM results WHERE run = 'watched'").item() == 1
