"""CommonRoad files in commonroad-io, and against CommonRoad's schemas."""

from __future__ import annotations

import json
import os
import subprocess
from pathlib import Path

import numpy as np
import pytest

from scenarionet_data import Lake, ScenarioLoader, convert
from scenarionet_data.interchange import writer_for
from scenarionet_data.interchange.base import Losses
from scenarionet_data.interchange.commonroad.layout import SOLUTION, WAITING
from scenarionet_data.interchange.files import INDEX, write_files
from scenarionet_data.interchange.lane_graph import read_lanes

ROOT = Path(__file__).parents[2]
PYTHON = ROOT / ".venv-interop" / "commonroad" / "bin" / "python"
SOURCES = {"scenarionet": "scenarionet", "waymo": "waymo/training", "gpudrive": "gpudrive",
           "argoverse2": "argoverse2/motion-forecasting/val", "interaction": "interaction"}  # fmt: skip

pytestmark = pytest.mark.interop


@pytest.fixture(scope="module")
def exported(tmp_path_factory):
    """Generated scenarios, and recorded ones where there are any: the lake, and their files by id."""
    if not PYTHON.exists():
        pytest.fail("no .venv-interop/commonroad: run `make test-interop`")
    folder = tmp_path_factory.mktemp("commonroad")
    convert("pg", "0:50", folder / "lake")
    data = os.environ.get("SCENARIONET_TEST_DATA")
    for name, raw in SOURCES.items() if data else ():
        convert(name, Path(data) / raw, folder / "lake")
    with_lanes = Lake(folder / "lake").select("num_map_features > 0")
    report = write_files(ScenarioLoader(folder / "lake", with_lanes), folder / "files", writer_for("commonroad"))
    assert report.refused == ()
    lines = map(json.loads, (folder / "files" / INDEX).read_text().splitlines())
    names = {line["scenario_id"]: next(name for name in line["files"] if not name.endswith(SOLUTION)) for line in lines}
    return folder, names


@pytest.mark.parametrize(
    ("schema", "pattern"), [("XML_commonRoad_XSD.xsd", "*[!n].xml"), ("CommonRoadSolution_schema.xsd", f"*{SOLUTION}")]
)
def test_schema(exported, schema, pattern):
    data = os.environ.get("SCENARIONET_TEST_DATA")
    path = Path(data or "", "exchange/schema", schema)
    if not data or not path.is_file():
        pytest.skip(f"CommonRoad's schemas: put {schema} of commonroad-io into $SCENARIONET_TEST_DATA/exchange/schema")
    files = [each for each in sorted((exported[0] / "files").glob("*.xml"))
             if each.name.endswith(SOLUTION) == pattern.endswith(SOLUTION)]  # fmt: skip
    done = subprocess.run(
        [PYTHON, ROOT / "tests/interop/validates.py", path, *files], capture_output=True, text=True, check=False
    )
    assert files and done.returncode == 0 and done.stdout == ""


def test_everything_is_where_it_was_recorded(exported):
    folder, names = exported
    done = subprocess.run(
        [PYTHON, ROOT / "tests/interop/opens_commonroad.py", *(folder / "files" / name for name in names.values())],
        capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr[-3000:]
    lines = done.stdout.splitlines()
    assert len(lines) == len(names)
    for scenario, line in zip(ScenarioLoader(folder / "lake", list(names)), lines, strict=True):
        found = json.loads(line)
        graph, tracks = read_lanes(scenario.map, Losses()), scenario.tracks
        crosswalks = found["lanelets"] - len(graph.lines)
        assert crosswalks >= 0 and found["links"] == len(graph.links)
        ego = scenario.ego_index
        seen = np.flatnonzero(tracks.valid.any(axis=1))
        assert len(found["states"]) == len(seen) - 1
        paths = [tracks.position[ego, tracks.valid[ego], :2]]
        read = [np.array(found["ego"])]
        for states in found["states"].values():
            rows = np.array(states)
            read.append(rows[~(rows[:, 1:3] == WAITING).all(axis=1)])
        # Which obstacle is which track: the one that is nearest to its states.
        for states in read:
            steps = states[:, 0].astype(int)
            away = np.abs(tracks.position[seen][:, steps, :2] - states[:, 1:3]).max(axis=(1, 2))
            away[~tracks.valid[seen][:, steps].all(axis=1)] = np.inf
            assert away.min() < 1e-3, scenario.id
            row = seen[int(away.argmin())]
            assert len(states) in (tracks.valid[row].sum(), 1)
            np.testing.assert_allclose(states[:, 3], tracks.heading[row, steps], atol=1e-5)
        assert len(read[0]) == len(paths[0])
