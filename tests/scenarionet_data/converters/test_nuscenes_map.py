"""nuScenes map expansion: conversion of every feature type of a written district."""

from __future__ import annotations

import json
from collections import Counter
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import shapely
from hypothesis import given
from hypothesis import strategies as st

from scenarionet_data.building import MapBuilder
from scenarionet_data.converters.nuscenes import NuScenes
from scenarionet_data.converters.nuscenes.areas import CELL, outlines, road_edges
from scenarionet_data.converters.nuscenes.map_features import read_map
from scenarionet_data.scenario.description import MapFeatures
from scenarionet_data.scenario.vocabulary import MapFeatureType, is_lane
from tests.fixtures import nuscenes as fixture
from tests.fixtures.nuscenes_world import CENTER, HALF, REACH, WIDTH, District, token, write_district
from tests.fixtures.reading import scenarios

PLACE = "singapore-onenorth"


@pytest.fixture(scope="module")
def read(tmp_path_factory: pytest.TempPathFactory) -> tuple[District, MapBuilder, MapFeatures]:
    folder = tmp_path_factory.mktemp("map")
    district = write_district(folder, PLACE)
    builder = read_map(folder / f"{PLACE}.json", "maps/expansion")
    return district, builder, builder.build(np.zeros(3))


def row(features: MapFeatures, *words: Any) -> int:
    return int(np.flatnonzero(features.ids == token(PLACE, *words))[0])


def of_type(features: MapFeatures, kind: str) -> list[int]:
    return np.flatnonzero(features.feature_type == MapFeatureType[kind]).tolist()


def extras(features: MapFeatures, index: int) -> dict[str, Any]:
    return json.loads(features.extras[index]) if features.extras[index] else {}


def test_every_record_is_converted(read: tuple[District, MapBuilder, MapFeatures]) -> None:
    district, _, features = read
    assert is_lane(features.feature_type).sum() == len(district.layers["lane"]) + len(district.layers["lane_connector"])
    for layer, kind in (("ped_crossing", "CROSSWALK"), ("stop_line", "STOP_LINE"), ("carpark_area", "CARPARK_AREA"),
                        ("road_block", "ROADBLOCK"), ("traffic_light", "TRAFFIC_LIGHT")):  # fmt: skip
        assert {features.ids[k] for k in of_type(features, kind)} == {r["token"] for r in district.layers[layer]}
    assert len(of_type(features, "INTERSECTION")) == 1
    assert "None" not in features.ids
    assert not set(features.ids) & {token(PLACE, "lane_divider", "empty"), token(PLACE, "walkway", "empty")}
    assert not read[1].build(np.zeros(3), has_z=False).polyline.values[:, 2].any()


def test_lanes_are_between_their_sides_and_connect(read: tuple[District, MapBuilder, MapFeatures]) -> None:
    district, _, features = read
    rows = {name: k for k, name in enumerate(features.ids)}
    for record in district.layers["lane"]:
        k = rows[record["token"]]
        line, area = shapely.LineString(features.polyline[k][:, :2]), shapely.Polygon(features.polygon[k][:, :2])
        assert line.within(area.buffer(0.1))
        assert line.hausdorff_distance(area.exterior) < WIDTH
    for k in np.flatnonzero(is_lane(features.feature_type)):
        for other in features.exit_lanes[k]:
            if other in rows:
                gap = features.polyline[k][-1] - features.polyline[rows[other]][0]
                assert np.hypot(*gap[:2]) < 1e-3
                assert features.ids[k] in features.entry_lanes[rows[other]]
    beyond = {other for k in rows.values() for other in features.exit_lanes[k]} - set(rows)
    assert beyond == {token("beyond the map", shape) for shape in ("LRL", "RLR")}


def test_one_sided_links_are_completed(read: tuple[District, MapBuilder, MapFeatures]) -> None:
    district, _, features = read
    connector = district.layers["lane_connector"]
    lefts = [c["token"] for c in connector if c["polygon_token"] is None]
    assert lefts
    for name in lefts:
        (goal,) = features.exit_lanes[features.ids.tolist().index(name)]
        assert name not in district.links[goal]["incoming"]
        assert name in features.entry_lanes[features.ids.tolist().index(goal)]


def test_lanes_reference_their_dividers_and_neighbors(read: tuple[District, MapBuilder, MapFeatures]) -> None:
    _, _, features = read
    inner, outer = row(features, "lane", 0, "in", 0), row(features, "lane", 0, "in", 1)
    middle, road = token(PLACE, "lane_divider", 0, 1), token(PLACE, "road_divider", 0)
    assert features.left_boundaries[inner].tolist() == [road]
    assert features.right_boundaries[inner].tolist() == [f"{middle}-{k}" for k in range(3)]
    assert features.left_boundaries[outer].tolist() == [f"{middle}-{k}" for k in range(3)]
    assert not len(features.right_boundaries[outer])
    assert features.right_neighbors[inner].tolist() == [features.ids[outer]]
    assert features.left_neighbors[outer].tolist() == [features.ids[inner]]
    assert not len(features.left_neighbors[inner])  # oncoming traffic beyond the road divider


def test_dividers_are_split_where_their_type_changes(read: tuple[District, MapBuilder, MapFeatures]) -> None:
    _, _, features = read
    stations = [HALF, 40.0, 70.0, 95.0, REACH]
    found = []
    for number in range(3):
        k = features.ids.tolist().index(f"{token(PLACE, 'lane_divider', 0, -1)}-{number}")
        found.append((MapFeatureType(features.feature_type[k]).name, (features.polyline[k][:, 0] - CENTER[0]).tolist()))
    assert found == [
        ("ROAD_LINE_BROKEN_SINGLE_WHITE", stations[:3]),
        ("ROAD_LINE_SOLID_SINGLE_WHITE", stations[2:4]),
        ("ROAD_LINE_SOLID_SINGLE_WHITE", stations[3:]),
    ]


def test_divider_types(read: tuple[District, MapBuilder, MapFeatures]) -> None:
    """Exact types state everything; others keep the map's word in the extras; an unstated type is assumed."""
    _, _, features = read
    lines = [(MapFeatureType(t).name, extras(features, k)) for k, t in enumerate(features.feature_type) if 16 <= t < 32]
    found = Counter((name, word.get("segment_type", "assumed" if word else "")) for name, word in lines)
    assert found == {
        ("ROAD_LINE_BROKEN_SINGLE_WHITE", "DOUBLE_DASHED_WHITE"): 2,
        ("ROAD_LINE_SOLID_SINGLE_WHITE", ""): 2,
        ("ROAD_LINE_SOLID_SINGLE_WHITE", "SINGLE_ZIGZAG_WHITE"): 2,
        ("UNKNOWN_LINE", "NIL"): 2,
        ("ROAD_LINE_SOLID_DOUBLE_WHITE", ""): 2,
        ("UNKNOWN_LINE", "HOVER_MARK"): 2,
        ("ROAD_LINE_SOLID_SINGLE_YELLOW", ""): 1,
        ("ROAD_LINE_SOLID_DOUBLE_YELLOW", ""): 1,
        ("ROAD_LINE_SOLID_SINGLE_YELLOW", "assumed"): 2,
    }


def test_stop_lines_hold_the_lanes_they_control(read: tuple[District, MapBuilder, MapFeatures]) -> None:
    district, _, features = read
    incoming = {n: [r["token"] for r in district.layers["lane"] if r["token"] in
                    {token(PLACE, "lane", n, "in", k) for k in range(2)}] for n in range(4)}  # fmt: skip
    kinds = {}
    for number in range(4):
        k = row(features, "stop_line", number)
        kinds[number] = extras(features, k).pop("stop_line_type")
        controlled = set(features.controlled_lanes[k])
        if number < 3:
            assert controlled == set(incoming[number])
        else:  # names no road block; matched by geometry
            assert controlled == {*incoming[3], token(PLACE, "lane", 3, "out", 0)}
    assert kinds == {0: "TRAFFIC_LIGHT", 1: "STOP_SIGN", 2: "PED_CROSSING", 3: "YIELD"}
    assert extras(features, row(features, "stop_line", 2))["ped_crossing_tokens"] == [token(PLACE, "ped_crossing", 2)]
    lights = [token(PLACE, "traffic_light", number) for number in range(2)]
    assert extras(features, row(features, "stop_line", 0))["traffic_light_tokens"] == lights
    turn = row(features, "stop_line", "turn")
    connectors = {record["token"] for record in district.layers["lane_connector"]}
    assert set(features.controlled_lanes[turn]) <= connectors
    assert len(features.controlled_lanes[turn]) == 4


def test_traffic_lights_are_at_their_map_positions(read: tuple[District, MapBuilder, MapFeatures]) -> None:
    district, _, features = read
    for number, record in enumerate(district.layers["traffic_light"]):
        k = row(features, "traffic_light", number)
        pose = record["pose"]
        np.testing.assert_allclose(features.polyline[k], [[pose["tx"], pose["ty"], pose["tz"]]], atol=1e-4)
        kept = extras(features, k)
        assert kept == {"heading": pose["rz"], "traffic_light_type": "VERTICAL", "items": record["items"]}
    first, second = (row(features, "traffic_light", number) for number in range(2))
    assert set(features.controlled_lanes[first]) == {token(PLACE, "lane", 0, "in", k) for k in range(2)}
    assert not len(features.controlled_lanes[second])


def test_intersections(read: tuple[District, MapBuilder, MapFeatures]) -> None:
    district, _, features = read
    inside = {features.ids[k] for k in np.flatnonzero((features.is_intersection == 1) & is_lane(features.feature_type))}
    assert inside == {record["token"] for record in district.layers["lane_connector"]}
    for name in inside:
        assert extras(features, features.ids.tolist().index(name)) == {"is_connector": True}


def test_areas_keep_their_holes(read: tuple[District, MapBuilder, MapFeatures]) -> None:
    """The road along x has an island: its parts exclude it, do not overlap, and are limited in size."""
    _, _, features = read
    parts = [shapely.Polygon(features.polygon[k][:, :2]) for k in of_type(features, "DRIVABLE_AREA")]
    assert sum(part.area for part in parts) == pytest.approx(240 * 14 - 4 * 0.6 + 2 * 7 * 113, abs=0.1)
    assert shapely.union_all(parts).area == pytest.approx(sum(part.area for part in parts), abs=0.1)
    assert not any(part.contains(shapely.Point(CENTER + np.array([32.0, 0.0]))) for part in parts)
    assert max(np.ptp(shapely.get_coordinates(part), axis=0).max() for part in parts) <= CELL
    walks = [shapely.Polygon(features.polygon[k][:, :2]) for k in of_type(features, "ROAD_EDGE_SIDEWALK")]
    assert sum(walk.area for walk in walks) == pytest.approx(4 * 108 * 3 - 2 * 2.0, abs=0.1)


def test_road_edges_have_the_road_on_their_left(read: tuple[District, MapBuilder, MapFeatures]) -> None:
    """Around the union of all areas and around the island, not between adjacent areas."""
    _, _, features = read
    areas = shapely.union_all([shapely.Polygon(features.polygon[k][:, :2]) for k in of_type(features, "DRIVABLE_AREA")])
    edges = [features.polyline[k][:, :2].astype(float) for k in of_type(features, "ROAD_EDGE_BOUNDARY")]
    assert sum(np.hypot(*np.diff(edge, axis=0).T).sum() for edge in edges) == pytest.approx(areas.length, abs=0.1)
    for edge in edges:
        ahead = np.diff(edge, axis=0)
        left = np.stack([-ahead[:, 1], ahead[:, 0]], axis=-1) / np.hypot(*ahead.T)[:, None]
        beside = (edge[1:] + edge[:-1]) / 2 + 0.1 * left
        assert shapely.contains_xy(areas, *beside.T).all()


def star(radii: list[float], center: tuple[float, float], turn: float = 0.0) -> np.ndarray:
    """A star-shaped polygon with one corner in each direction."""
    angle = np.linspace(0.0, 2 * np.pi, len(radii), endpoint=False) + turn
    return np.array(center) + np.array(radii)[:, None] * np.stack([np.cos(angle), np.sin(angle)], axis=-1)


@given(
    outer=st.lists(st.floats(80, 300), min_size=6, max_size=12),
    holes=st.lists(st.lists(st.floats(1, 9), min_size=3, max_size=6), max_size=3),
    turn=st.floats(0, 6),
    cell=st.floats(20.0, 700.0),
)
def test_parts_cover_the_polygon(outer: list[float], holes: list[list[float]], turn: float, cell: float) -> None:
    exterior = star(outer, (600.0, 1200.0), turn)
    inside = [star(hole, (580.0 + 20.0 * k, 1200.0), turn * k) for k, hole in enumerate(holes)]
    area = shapely.Polygon(exterior, inside)
    parts = [shapely.Polygon(part) for part in outlines(exterior, inside, cell)]
    assert all(part.is_valid for part in parts)
    assert sum(part.area for part in parts) == pytest.approx(area.area, rel=1e-9)
    assert shapely.union_all(parts).symmetric_difference(area).area < 1e-3
    assert all(np.ptp(shapely.get_coordinates(part), axis=0).max() <= cell + 1e-9 for part in parts)


def test_self_intersecting_outline_is_accepted() -> None:
    bow = np.array([[0.0, 0.0], [10.0, 10.0], [10.0, 0.0], [0.0, 10.0]])
    assert len(outlines(bow, [])) == 1
    assert sum(shapely.Polygon(part).area for part in outlines(bow * 30.0, [])) == pytest.approx(50.0 * 900)
    assert len(road_edges([(bow, [])])) == 2


def test_scenario_map_is_the_crop_around_its_path(tmp_path: Path) -> None:
    (scene,) = fixture.write_invented(tmp_path, num_scenes=1, num_keyframes=11)
    whole = read_map(tmp_path / "maps" / "expansion" / f"{PLACE}.json", "maps/expansion")
    converter = NuScenes()
    (wide,) = scenarios(converter, tmp_path, "mini")
    (narrow,) = scenarios(converter, tmp_path, "mini", radius=10.0)
    assert wide.map is not None
    assert narrow.map is not None
    assert len(wide.map) == len(whole) > len(narrow.map) > 0
    assert (wide.map_id, narrow.map_id) == (PLACE, PLACE)
    path = narrow.tracks.position[narrow.ego_index, :, :2]
    low, high = path.min(axis=0) - 10.0, path.max(axis=0) + 10.0
    np.testing.assert_allclose(narrow.map_crop, [*low, *high], atol=1e-3)
    for k in range(len(narrow.map)):
        points = np.concatenate([narrow.map.polyline[k], narrow.map.polygon[k]])[:, :2]
        assert (points.max(axis=0) >= low - 1e-3).all()
        assert (points.min(axis=0) <= high + 1e-3).all()
    lights = wide.map.feature_type == MapFeatureType.TRAFFIC_LIGHT
    z = wide.map.polyline.values[:, 2] + wide.origin[2]
    assert set(np.round(z[~np.repeat(lights, wide.map.polyline.lengths)], 6)) == {0.0}
    assert scene.location == PLACE
