"""SUMO's own programs load what is exported, and show every object where it was recorded."""

from __future__ import annotations

import os
import subprocess
from pathlib import Path

import pytest

from scenarionet_data import Lake, ScenarioLoader, convert
from scenarionet_data.interchange import writer_for
from scenarionet_data.interchange.files import write_files
from scenarionet_sim.evaluation.adding import add_run

TOOLS = Path(__file__).parents[2] / ".venv-interop" / "tools" / "bin"
SOURCES = {"scenarionet": "scenarionet", "waymo": "waymo/training", "gpudrive": "gpudrive",
           "argoverse2": "argoverse2/motion-forecasting/val"}  # fmt: skip

pytestmark = pytest.mark.interop


@pytest.fixture(scope="module")
def exported(tmp_path_factory) -> list[Path]:
    """Configurations of generated scenarios, and of recorded ones where there are any."""
    if not TOOLS.exists():
        pytest.fail("no .venv-interop: run `make test-interop`")
    folder = tmp_path_factory.mktemp("sumo")
    convert("pg", "0:30", folder / "lake")
    data = os.environ.get("SCENARIONET_TEST_DATA")
    for name, raw in SOURCES.items() if data else ():
        convert(name, Path(data) / raw, folder / "lake")
    with_lanes = Lake(folder / "lake").select("num_map_features > 0")
    report = write_files(ScenarioLoader(folder / "lake", with_lanes), folder / "files", writer_for("sumo"))
    assert report.refused == ()
    return sorted((folder / "files").glob("*.sumocfg"))


def test_sumo_drives_on_every_net(exported):
    """Its own vehicles depart on the recorded routes; whoever is where another is does so later."""
    for config in exported:
        done = subprocess.run(
            [TOOLS / "sumo", "-c", config, "--no-step-log", "--xml-validation", "never"],
            capture_output=True, text=True, check=False,
        )  # fmt: skip
        assert done.returncode == 0 and "Error" not in done.stderr, (config.name, done.stderr)


def test_what_sumos_drivers_did_comes_back_as_a_run(tmp_path):
    convert("pg", "0:6", tmp_path / "lake")
    lake = Lake(tmp_path / "lake")
    assert write_files(ScenarioLoader(lake), tmp_path / "files", writer_for("sumo")).refused == ()
    for config in (tmp_path / "files").glob("*.sumocfg"):
        motion = config.with_suffix(".fcd.xml")
        words = "-c", config, "--step-length", "0.1", "--fcd-output", motion, "--xml-validation", "never"
        subprocess.run([TOOLS / "sumo", *words], capture_output=True, check=True)
    convert("sumo", tmp_path / "files", tmp_path / "played")
    added = add_run(lake, tmp_path / "played", "sumo")
    assert (added.scenarios, added.broken, added.unknown_objects) == (6, [], 0)
    results = lake.sql("SELECT * FROM results WHERE run = 'sumo'")
    assert results["route_completion"].mean() > 0.5, "its drivers drive along the routes"
    assert results["final_displacement"].min() > 0.5, "and are not the recording"


def test_replays_are_where_objects_were_recorded(exported):
    off = {}
    for config in exported:
        done = subprocess.run(
            [TOOLS / "python", config.parent / "replay.py", config.with_suffix("")],
            capture_output=True, text=True, check=False,
        )  # fmt: skip
        assert done.returncode == 0, (config.name, done.stderr[-2000:])
        off[config.name] = float(done.stdout.splitlines()[-1].split()[0])
    assert {name: error for name, error in off.items() if error > 0.01} == {}
