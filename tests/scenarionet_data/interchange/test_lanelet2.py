"""Lanelet2 maps, read back by the reader of Lanelet2 maps."""

from __future__ import annotations

from pathlib import Path
from xml.etree import ElementTree as Xml

import numpy as np
import pytest

from scenarionet_data import Lake, ScenarioLoader
from scenarionet_data.building import MapBuilder
from scenarionet_data.building.projection import to_utm, utm_zone
from scenarionet_data.converters.formats.lanelet2 import read_lanelet2
from scenarionet_data.errors import InvalidScenario
from scenarionet_data.interchange import writer_for
from scenarionet_data.interchange.base import Losses
from scenarionet_data.interchange.lanelet2.sides import share_sides
from scenarionet_data.interchange.lanelet2.writer import ANCHOR, degrees_of
from scenarionet_data.interchange.lanelets import make_lanelets
from scenarionet_data.interchange.numbering import light_number, number_ids
from scenarionet_data.scenario.vocabulary import MapFeatureType, is_lane
from tests.fixtures.drives import make_drive
from tests.fixtures.scenarios import small
from tests.scenarionet_data.interchange.conformance import WriterConformance

LANE = MapFeatureType.LANE_SURFACE_STREET


class TestLanelet2(WriterConformance):
    name = "lanelet2"


def there_and_back(scenario, folder: Path):
    """The lanelets by number, the map as it is read again, and the losses."""
    losses = Losses()
    (content,) = writer_for("lanelet2").write(scenario, "map", losses).values()
    (folder / "map.osm").write_bytes(content)
    builder = read_lanelet2(folder / "map.osm")
    assert builder.defects == ()
    lanelets = make_lanelets(scenario.map, Losses())
    named = {"map features": [scenario.map.ids[lanelet.row] for lanelet in lanelets]}
    numbers = number_ids(named, Losses(), first=1)[0]["map features"]
    return dict(zip(numbers, lanelets, strict=True)), builder.build(np.zeros(3)), losses


def test_lanes_links_neighbours_and_limits_come_back(lake, tmp_path):
    for scenario in ScenarioLoader(lake):
        lanelets, read, losses = there_and_back(scenario, tmp_path)
        told = {loss.what: loss for loss in losses.found()}
        number_of = {lanelet.row: str(number) for number, lanelet in lanelets.items()}
        row_of = {name: row for row, name in enumerate(read.ids)}
        assert set(read.ids[is_lane(read.feature_type)]) == set(number_of.values())
        lost, error = 0, max(
            (told[what].error for what in told if what.startswith(("corners", "sides", "lanes whose"))), default=0.0
        )  # fmt: skip
        for number, lanelet in lanelets.items():
            row = row_of[str(number)]
            assert {number_of[other] for other in lanelet.after} == set(read.exit_lanes[row])
            assert {number_of[other] for other in lanelet.before} == set(read.entry_lanes[row])
            beside = {number_of[lanelet.on_right.row]} if lanelet.on_right else set()
            assert set(read.right_neighbors[row]) <= beside
            lost += len(beside) - len(read.right_neighbors[row])
            limit, expected = read.speed_limit[row], scenario.map.speed_limit[lanelet.row]
            np.testing.assert_allclose(limit, expected, atol=1e-3)
            centre = scenario.map.polyline[lanelet.row]
            for end in (0, -1):
                assert np.hypot(*(read.polyline[row][end] - centre[end])[:2]) < error + 2e-3
        left_out = told.get("neighbours of lanes that join, part, or lie beside each other in part only")
        assert lost == (left_out.count if left_out else 0)


def test_lights_and_stop_signs_are_rules_of_their_lanes(lake, tmp_path):
    scenario = next(each for each in ScenarioLoader(lake) if len(each.lights))
    there_and_back(scenario, tmp_path)
    root = Xml.parse(tmp_path / "map.osm").getroot()
    relations = {each.get("id"): each for each in root.findall("relation")}
    rules = [each for each in relations.values() if tag(each, "subtype") == "traffic_light"]
    assert len(rules) == len(scenario.lights)
    ways = {each.get("id"): each for each in root.findall("way")}
    for rule in rules:
        members = {each.get("role"): ways[each.get("ref")] for each in rule.findall("member")}
        assert (tag(members["refers"], "type"), tag(members["ref_line"], "type")) == ("traffic_light", "stop_line")
        (lane,) = [each for each in relations.values() for member in each.findall("member")
                   if member.get("ref") == rule.get("id")]  # fmt: skip
        sides = {member.get("role"): ways[member.get("ref")] for member in lane.findall("member")[:2]}
        ends = [[sides[side].findall("nd")[place].get("ref") for side in ("left", "right")] for place in (0, -1)]
        assert [each.get("ref") for each in members["ref_line"].findall("nd")] in ends


def test_the_stop_line_of_a_light_is_at_the_end_of_its_lane_that_is_nearer(tmp_path):
    """The light stops vehicles at the beginning of the lane after the middle of the road, where x is 20 m."""
    (content,) = writer_for("lanelet2").write(make_drive(red=True), "map", Losses()).values()
    root = Xml.fromstring(content)
    ways = {each.get("id"): [node.get("ref") for node in each.iter("nd")] for each in root.iter("way")}
    along = {each.get("id"): float(tag(each, "local_x")) for each in root.iter("node")}
    (rule,) = (each for each in root.iter("relation") if tag(each, "subtype") == "traffic_light")
    (line,) = (each.get("ref") for each in rule.iter("member") if each.get("role") == "ref_line")
    assert [along[node] for node in ways[line]] == [20.0, 20.0]
    assert int(rule.get("id")) == light_number("right_b") > max(map(int, ways))


def test_stop_signs_come_back_with_their_lanes(tmp_path):
    builder = MapBuilder()
    builder.add("5", LANE, polyline=[[0, 0, 0], [20, 0, 0]], width=[[1.75, 1.75]])
    builder.add("9", MapFeatureType.STOP_SIGN, polyline=[[20, -3, 0]], controlled_lanes=["5"])
    builder.add("10", MapFeatureType.CROSSWALK, polygon=[[10, -3, 0], [12, -3, 0], [12, 3, 0], [10, 3, 0]])
    scenario = small(0, has_map=True)
    object.__setattr__(scenario, "map", builder.build(np.zeros(3)))
    _, read, _ = there_and_back(scenario, tmp_path)
    (sign,) = np.flatnonzero(read.feature_type == MapFeatureType.STOP_SIGN)
    np.testing.assert_allclose(read.polyline[sign][0], [20, -3, 0], atol=1e-3)
    assert list(read.controlled_lanes[sign]) == ["5"]
    (walk,) = np.flatnonzero(read.feature_type == MapFeatureType.CROSSWALK)
    corners = sorted(map(tuple, read.polygon[walk].round(3).tolist()))
    assert corners == [(10, -3, 0), (10, 3, 0), (12, -3, 0), (12, 3, 0)]


def test_lanes_that_join_keep_their_links_and_lose_their_side(tmp_path):
    """Two lanes beside each other lead to the same lane: with one line between them, both would end in a point."""
    builder = MapBuilder()
    more = {"width": [[1.75, 1.75]]}
    builder.add("1", LANE, polyline=[[0, 0, 0], [20, 0, 0]], exit_lanes=["3"], right_neighbors=["2"], **more)
    builder.add("2", LANE, polyline=[[0, -3.5, 0], [20, -3.5, 0]], exit_lanes=["3"], left_neighbors=["1"], **more)
    builder.add("3", LANE, polyline=[[20, -1.75, 0], [40, -1.75, 0]], entry_lanes=["1", "2"], **more)
    losses = Losses()
    lanelets = make_lanelets(builder.build(np.zeros(3)), losses)
    corners, left_of = share_sides(lanelets, losses)
    assert left_of == {}
    told = {loss.what: loss.count for loss in losses.found()}
    assert told == {"neighbours of lanes that join, part, or lie beside each other in part only": 1}
    points = corners.points(Losses())
    ends = [points[corner][0] for corner in points if corner.is_end and corner.row != 2]
    assert len(set(ends)) == 2  # left and right, of both


def test_degrees_are_the_inverse_of_utm():
    rng = np.random.default_rng(0)
    plane = rng.uniform(-20_000, 20_000, (100, 2))
    degrees = degrees_of(plane)
    zone = utm_zone(ANCHOR[1])
    start = to_utm(np.array([ANCHOR[0]]), np.array([ANCHOR[1]]), zone)
    np.testing.assert_allclose(to_utm(degrees[:, 0], degrees[:, 1], zone) - start, plane, atol=1e-5)


def test_every_point_is_where_its_degrees_are(lake, tmp_path):
    there_and_back(Lake(lake).loader()[0], tmp_path)
    by_metres = read_lanelet2(tmp_path / "map.osm").build(np.zeros(3))
    by_degrees = read_lanelet2(tmp_path / "map.osm", ANCHOR).build(np.zeros(3))
    np.testing.assert_allclose(by_metres.polyline.values, by_degrees.polyline.values, atol=1e-3)


def test_scenarios_without_a_map_are_refused():
    with pytest.raises(InvalidScenario, match="expected a map, found none"):
        writer_for("lanelet2").write(small(0, has_map=False), "scene", Losses())


def tag(element: Xml.Element, key: str) -> str | None:
    return next((each.get("v") for each in element.findall("tag") if each.get("k") == key), None)
