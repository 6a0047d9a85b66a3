"""Programs of Scenic's driving domain on this simulator, over a road that is exported here."""

from __future__ import annotations

import json
import os
import subprocess
from pathlib import Path

import pytest

from scenarionet_data import ScenarioLoader, convert
from scenarionet_data.interchange import writer_for
from scenarionet_data.interchange.files import write_files
from scenarionet_sim.drivers.requirements import made_interpreter

ROOT = Path(__file__).parents[2]

pytestmark = pytest.mark.interop

PROGRAM = """
param map = localPath('road.xodr')
model scenic.domains.driving.model

behavior Cross():
    take SetWalkingDirectionAction(self.heading), SetWalkingSpeedAction(2)

ego = new Car with behavior FollowLaneBehavior(target_speed=8)
new Pedestrian ahead of ego by 30, facing 90 deg relative to ego, with behavior Cross, with regionContainedIn None
"""


def sample(program: Path, road: Path, number: int, steps: int) -> dict[str, float]:
    python = made_interpreter(str(ROOT / "tests" / "interop" / "scenic.txt"))
    words = [python, "-m", "tests.interop.samples_scenic", str(program), str(road), str(number), str(steps)]
    path = os.pathsep.join([str(ROOT), str(ROOT / "pipelines")])
    done = subprocess.run(words, capture_output=True, text=True, env=os.environ | {"PYTHONPATH": path})
    assert done.returncode == 0, done.stderr[-2000:]
    return json.loads(done.stdout.splitlines()[-1])


def test_a_program_on_an_exported_road(tmp_path):
    convert("logical", "cut_in", tmp_path / "lake", options={"number": 1})
    write_files(ScenarioLoader(tmp_path / "lake"), tmp_path / "files", writer_for("opendrive"))
    (road,) = (tmp_path / "files").rglob("*.xodr")
    (tmp_path / "cross.scenic").write_text(PROGRAM)
    found = sample(tmp_path / "cross.scenic", road, 5, 50)
    assert found["simulated"] == 5
    assert 15.0 < found["way"] < 50.0, "5 s at up to 8 m/s from standstill or on the way"
    assert found["on_road"] > 0.9


@pytest.mark.parametrize(
    ("name", "town"),
    [
        ("pedestrianJaywalking", "Town01"),
        ("badlyParkedCarPullingIn", "Town01"),
        ("Carla_Challenge/carlaChallenge3", "Town01"),
        ("OAS_Scenarios/oas_scenario_03", "Town01"),
        ("OAS_Scenarios/oas_scenario_30", "Town10HD"),
    ],
)
def test_examples_of_its_repository_run_unchanged(name, town):
    """With a checkout of Scenic at SCENIC_CHECKOUT, on maps of it."""
    if not os.environ.get("SCENIC_CHECKOUT"):
        pytest.skip("set SCENIC_CHECKOUT to the folder of a checkout of Scenic")
    checkout = Path(os.environ["SCENIC_CHECKOUT"])
    road = checkout / "assets" / "maps" / "CARLA" / f"{town}.xodr"
    found = sample(checkout / "examples" / "driving" / f"{name}.scenic", road, 5, 100)
    assert found["simulated"] >= 4 and found["on_road"] > 0.9
