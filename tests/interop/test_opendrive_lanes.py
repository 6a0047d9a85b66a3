"""OpenDRIVE maps as they are read, against esmini's road manager: lane centres every metre."""

from __future__ import annotations

import ctypes
import os
from pathlib import Path
from xml.etree import ElementTree as Xml

import numpy as np
import pytest
import shapely

from scenarionet_data import Lake, ScenarioLoader, convert
from scenarionet_data.converters.formats.opendrive.reader import LANES, read_opendrive
from scenarionet_data.interchange import writer_for
from scenarionet_data.interchange.files import write_files
from tests.interop.test_opendrive import SOURCES

PLAYER = os.environ.get("SCENARIONET_ESMINI")
DATA = os.environ.get("SCENARIONET_TEST_DATA")

pytestmark = [
    pytest.mark.interop,
    pytest.mark.skipif(PLAYER is None, reason="set SCENARIONET_ESMINI to the player esmini, beside libesminiRMLib.so"),
]
_VALUES = ("x", "y", "z", "h", "p", "r", "h_relative")


class Place(ctypes.Structure):
    _fields_ = [
        *((name, ctypes.c_double) for name in _VALUES),
        *(("road", ctypes.c_uint32), ("junction", ctypes.c_uint32), ("lane", ctypes.c_int)),
        *(("offset", ctypes.c_double), ("s", ctypes.c_double)),
    ]


def lane_points(path: Path) -> dict[str, np.ndarray]:
    """Centre of each lane (n, 3) at each metre, by the id that the reader gives it."""
    library = ctypes.CDLL(str(Path(PLAYER).with_name("libesminiRMLib.so")))
    real, road_id = ctypes.c_double, ctypes.c_uint32
    library.RM_GetRoadIdFromString.argtypes, library.RM_GetRoadIdFromString.restype = [ctypes.c_char_p], road_id
    library.RM_SetLanePosition.argtypes = [ctypes.c_int, road_id, ctypes.c_int, real, real, ctypes.c_bool]
    assert library.RM_Init(str(path).encode()) == 0
    handle, place, found = library.RM_CreatePosition(), Place(), {}
    for road in Xml.parse(path).getroot().findall("road"):
        number = library.RM_GetRoadIdFromString(road.get("id").encode())
        sections = road.findall("lanes/laneSection")
        ends = [*(float(each.get("s")) for each in sections[1:]), float(road.get("length"))]
        for section, (element, end) in enumerate(zip(sections, ends, strict=True)):
            for lane in element.iter("lane"):
                points = []
                for s in np.arange(float(element.get("s")) + 0.01, end - 0.01, 1.0):
                    if lane.get("type") in LANES and lane.get("id") != "0":
                        library.RM_SetLanePosition(handle, number, int(lane.get("id")), 0.0, float(s), False)
                        library.RM_GetPositionData(handle, ctypes.byref(place))
                        assert place.lane == int(lane.get("id")), (path.name, road.get("id"), s)
                        points.append((place.x, place.y, place.z))
                if points:
                    found[f"{road.get('id')}_{section}_{lane.get('id')}"] = np.array(points)
    library.RM_Close()
    return found


def check_lanes(path: Path) -> float:
    """Largest distance of esmini's lane centres from those that are read."""
    shift = [each.get("value").split() for each in Xml.parse(path).iter("userData") if each.get("code") == "origin"]
    origin = np.array([float(text) for text in shift[0]] if shift else [0.0, 0.0, 0.0])
    features = read_opendrive(path).build(origin)
    worst, rows = 0.0, {name: row for row, name in enumerate(features.ids)}
    expected = lane_points(path)
    assert set(expected) == {name for name, row in rows.items() if features.feature_type[row] <= 4} - short(path)
    for name, points in expected.items():
        line = features.polyline[rows[name]].astype(float)
        away = shapely.distance(shapely.linestrings(line[:, :2]), shapely.points(points[:, :2])).max()
        order = np.argsort(shapely.line_locate_point(shapely.linestrings(line[:, :2]), shapely.points(line[:, :2])))
        along = shapely.line_locate_point(shapely.linestrings(line[:, :2]), shapely.points(points[:, :2]))
        at = shapely.line_locate_point(shapely.linestrings(line[:, :2]), shapely.points(line[:, :2]))
        height = np.abs(np.interp(along, at[order], line[order, 2]) - points[:, 2]).max()
        assert height < 0.05, (path.name, name, height)
        worst = max(worst, float(away))
    return worst


def short(path: Path) -> set[str]:
    """Lanes of sections that are shorter than two centimetres."""
    found = set()
    for road in Xml.parse(path).getroot().findall("road"):
        sections = road.findall("lanes/laneSection")
        ends = [*(float(each.get("s")) for each in sections[1:]), float(road.get("length"))]
        for number, (section, end) in enumerate(zip(sections, ends, strict=True)):
            if end - float(section.get("s")) <= 0.02:
                found |= {f"{road.get('id')}_{number}_{lane.get('id')}" for lane in section.iter("lane")}
    return found


@pytest.mark.skipif(DATA is None, reason="set SCENARIONET_TEST_DATA to the folder with exchange")
def test_maps_of_others():
    paths = sorted((Path(DATA) / "exchange").rglob("*.xodr"))
    worst = {path.name: check_lanes(path) for path in paths}
    print(worst)
    assert len(worst) >= 12 and max(worst.values()) <= 0.02


def test_maps_that_are_exported(tmp_path):
    convert("pg", "0:10", tmp_path / "lake")
    for name, raw in SOURCES.items() if DATA else ():
        convert(name, Path(DATA) / raw, tmp_path / "lake")
    ids = Lake(tmp_path / "lake").select("num_map_features > 0")
    write_files(ScenarioLoader(tmp_path / "lake", ids), tmp_path / "maps", writer_for("opendrive"))
    worst = {path.name: check_lanes(path) for path in sorted((tmp_path / "maps").glob("*.xodr"))}
    print(worst)
    assert len(worst) >= 10 and max(worst.values()) <= 0.02
