"""MetaDrive opens, checks and drives exported scenarios, in a separate environment (``make_environment.sh``)."""

from __future__ import annotations

import json
import os
import subprocess
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from scenarionet_data import converters
from scenarionet_data.export import export
from scenarionet_data.export.describe import identify
from scenarionet_data.scenario.description import ScenarioDescription
from scenarionet_data.scenario.vocabulary import is_lane
from tests.fixtures import scenarionet_pickles as made
from tests.fixtures.scenarios import make_scenario

pytestmark = pytest.mark.metadrive

RECORDINGS = {"scenarionet": "scenarionet", "waymo": "waymo", "argoverse2": "argoverse2/motion-forecasting/val"}
ENVIRONMENT = Path(__file__).parents[2] / ".venv-metadrive"


def run(arguments: Sequence[str | Path], numpy1: bool = False) -> str:
    python = ENVIRONMENT / "bin" / "python"
    if not python.exists():
        pytest.skip("no .venv-metadrive: run tests/metadrive/make_environment.sh")
    paths = str(ENVIRONMENT / "numpy1") if numpy1 else ""
    environment = {**os.environ, "PYTHONPATH": paths, "PYTHONWARNINGS": "ignore"}
    done = subprocess.run([python, *arguments], env=environment, capture_output=True, text=True, timeout=900)
    assert done.returncode == 0, done.stderr[-3000:]
    return done.stdout


def accept(task: str, database: Path, numpy1: bool = False) -> dict[str, Any]:
    lines = run([Path(__file__).with_name("accept.py"), task, database], numpy1).splitlines()
    (result,) = [json.loads(line.removeprefix("RESULT")) for line in lines if line.startswith("RESULT")]
    return result


def converted(dataset: str, raw: str | Path) -> list[ScenarioDescription]:
    converter = converters.get(dataset)
    shards = converter.shards(str(raw), "train", converter.release, converter.Options())
    return [converter.scenario(shard, record) for shard in shards for record in converter.records(shard)]


@pytest.fixture(scope="module")
def scenarios(tmp_path_factory: pytest.TempPathFactory) -> dict[str, ScenarioDescription]:
    """By file name: hand-made, generated, imported from every format generation, and recorded where available."""
    found = [make_scenario(1), make_scenario(2, has_z=False), make_scenario(5, dataset="nuscenes", version="v1.0")]
    found += [make_scenario(4, has_map=False), make_scenario(7, num_lights=0)]
    found += converted("scenarionet", made.write_vintages(tmp_path_factory.mktemp("raw")))
    found += converted("pg", "0:2")
    if folder := os.environ.get("SCENARIONET_TEST_DATA"):
        for dataset, raw in RECORDINGS.items():
            found += converted(dataset, Path(folder) / raw)
    return {identify(scenario).file_name: scenario for scenario in found}


@pytest.fixture(scope="module")
def database(scenarios: dict[str, ScenarioDescription], tmp_path_factory: pytest.TempPathFactory) -> Path:
    report = export(scenarios.values(), tmp_path_factory.mktemp("exported") / "db", original=False)
    assert report.num_scenarios == len(scenarios)
    return report.directory


@pytest.fixture(scope="module")
def checked(database: Path) -> dict[str, Any]:
    return accept("check", database)


@pytest.fixture(scope="module")
def replayed(database: Path) -> dict[str, Any]:
    return accept("replay", database)


def test_metadrive_checks_and_lists_every_file(checked: dict[str, Any], scenarios: dict[str, Any]) -> None:
    assert checked["names"] == list(scenarios)
    assert list(checked["found"]) == list(scenarios)


def test_summaries_match_metadrives_own(checked: dict[str, Any], scenarios: dict[str, ScenarioDescription]) -> None:
    for name, found in checked["found"].items():
        assert found["same_objects"] and found["same_numbers"] and found["same_listed"], name
        assert found["num_objects"] == len(scenarios[name].tracks)


def test_metadrive_can_move_the_origin(checked: dict[str, Any]) -> None:
    """It does so in place, so the arrays must be writable."""
    for name, found in checked["found"].items():
        assert found["ego_at"] == pytest.approx([0, 0], abs=1e-3), name


def test_every_replay_arrives(replayed: dict[str, Any], scenarios: dict[str, Any]) -> None:
    assert list(replayed["found"]) == list(scenarios)
    assert {
        name: found["route_completion"] for name, found in replayed["found"].items() if not found["arrive_dest"]
    } == {}


def test_simulator_uses_the_true_ego(replayed: dict[str, Any], scenarios: dict[str, ScenarioDescription]) -> None:
    for name, found in replayed["found"].items():
        scenario = scenarios[name]
        assert found["ego_size"] == pytest.approx(scenario.tracks.size[scenario.ego_index, 0].tolist(), abs=1e-4), name


def test_simulator_uses_the_map_and_the_lights(replayed: dict[str, Any], scenarios: dict[str, Any]) -> None:
    for name, found in replayed["found"].items():
        features, lights = scenarios[name].map, scenarios[name].lights
        if features is None:
            assert found["num_lanes"] == 0
            continue
        drivable = set(features.ids[is_lane(features.feature_type) & (features.polyline.lengths > 1)])
        assert found["num_lanes"] == len(drivable), name
        assert found["num_lights"] == len(drivable & set(lights.lane_ids)), name


def test_numpy_1_and_2_load_equal_data(database: Path) -> None:
    second, first = accept("load", database), accept("load", database, numpy1=True)
    assert second["numpy"].startswith("2.") and first["numpy"].startswith("1.26")
    assert second["writable"] and first["writable"]
    assert second["totals"] == first["totals"]
    assert np.isfinite(list(second["totals"].values())).all()


@pytest.mark.parametrize("command", ["check_existence", "check_simulation"])
def test_original_scenarionet_commands_run(command: str, database: Path, tmp_path: Path) -> None:
    if "yes" not in run(["-c", "import importlib.util as u; print('yes' if u.find_spec('scenarionet') else 'no')"]):
        pytest.skip("no ScenarioNet in .venv-metadrive: it is on no package index; install a checkout of it there")
    run(["-m", f"scenarionet.{command}", "-d", database, "--error_file_path", tmp_path, "--num_workers", "2"])
    assert list(tmp_path.iterdir()) == []
