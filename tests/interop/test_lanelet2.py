"""Lanelet2's own routing graph of what is exported has every link, and every neighbour that is not told as lost."""

from __future__ import annotations

import json
import os
import subprocess
from collections import Counter
from pathlib import Path

import numpy as np
import pytest

from scenarionet_data import Lake, ScenarioLoader, convert
from scenarionet_data.interchange import writer_for
from scenarionet_data.interchange.base import Losses
from scenarionet_data.interchange.lanelet2.sides import share_sides
from scenarionet_data.interchange.lanelets import make_lanelets
from scenarionet_data.interchange.numbering import number_ids
from scenarionet_data.scenario.vocabulary import MapFeatureType

ROOT = Path(__file__).parents[2]
PYTHON = ROOT / ".venv-interop" / "tools" / "bin" / "python"
SOURCES = {"scenarionet": "scenarionet", "waymo": "waymo/training", "gpudrive": "gpudrive",
           "argoverse2": "argoverse2/motion-forecasting/val", "interaction": "interaction"}  # fmt: skip

pytestmark = pytest.mark.interop


def test_routing_graph(tmp_path):
    if not PYTHON.exists():
        pytest.fail("no .venv-interop: run `make test-interop`")
    convert("pg", "0:50", tmp_path / "lake")
    data = os.environ.get("SCENARIONET_TEST_DATA")
    for name, raw in SOURCES.items() if data else ():
        convert(name, Path(data) / raw, tmp_path / "lake")
    scenarios = ScenarioLoader(tmp_path / "lake", Lake(tmp_path / "lake").select("num_map_features > 0"))
    for number, scenario in enumerate(scenarios):
        (content,) = writer_for("lanelet2").write(scenario, "map", Losses()).values()
        (tmp_path / f"{number}.osm").write_bytes(content)
    files = [tmp_path / f"{number}.osm" for number in range(len(scenarios))]
    done = subprocess.run(
        [PYTHON, ROOT / "tests/interop/opens_lanelet2.py", *files], capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr[-2000:]
    lines = done.stdout.splitlines()
    assert len(lines) == len(files)
    for scenario, line in zip(scenarios, lines, strict=True):
        found = json.loads(line)
        lanelets = make_lanelets(scenario.map, Losses())
        named = {"map features": [scenario.map.ids[lanelet.row] for lanelet in lanelets]}
        numbers = number_ids(named, Losses(), first=1)[0]["map features"]
        number_of = {lanelet.row: number for lanelet, number in zip(lanelets, numbers, strict=True)}
        assert found["errors"] == [] and found["lanes"] == len(lanelets), scenario.id
        links = {(number_of[lanelet.row], number_of[other]) for lanelet in lanelets for other in lanelet.after}
        assert set(map(tuple, found["links"])) == links, scenario.id
        corners, left_of = share_sides(lanelets, Losses())
        beside = {(number_of[other], number_of[row]) for row, other in left_of.items()}
        assert set(map(tuple, found["beside"])) == beside, scenario.id
        points = corners.points(Losses())
        for corner, (_, place) in points.items():
            if corner.is_end != corner.is_left:  # the first point on the left, the last on the right
                x, y = found["places"][str(number_of[corner.row])][int(corner.is_end)]
                np.testing.assert_allclose((x, y), place[:2], atol=1e-3)
        ids = set(scenario.map.ids[[lanelet.row for lanelet in lanelets]])
        signs = [
            lane
            for row in np.flatnonzero(scenario.map.feature_type == MapFeatureType.STOP_SIGN)
            for lane in scenario.map.controlled_lanes[row]
        ]
        rules = Counter(TrafficLight=sum(lane in ids for lane in scenario.lights.lane_ids))
        rules["TrafficSign"] = sum(lane in ids for lane in signs)
        assert Counter(found["rules"]) == +rules, scenario.id
