"""SUMO's nets, routes and recorded motion, read back as XML."""

from __future__ import annotations

import itertools
from dataclasses import replace
from xml.etree import ElementTree as Xml

import numpy as np
import pytest

from scenarionet_data import Lake, ScenarioLoader
from scenarionet_data.errors import InvalidScenario
from scenarionet_data.interchange import writer_for
from scenarionet_data.interchange.base import Losses
from scenarionet_data.interchange.lane_graph import read_lanes
from scenarionet_data.scenario.vocabulary import ObjectType
from tests.fixtures.scenarios import make_scenario, small
from tests.scenarionet_data.interchange.conformance import WriterConformance


class TestSumo(WriterConformance):
    name = "sumo"


def written(scenario, losses=None):
    found = writer_for("sumo").write(scenario, "scene", losses or Losses())
    return {name.removeprefix("scene."): Xml.fromstring(text) for name, text in found.items() if name != "replay.py"}


@pytest.mark.integration
def test_every_lane_and_link_is_in_the_net(lake):
    for scenario in ScenarioLoader(lake):
        net, graph = written(scenario)["net.xml"], read_lanes(scenario.map, Losses())
        edges = [edge for edge in net.findall("edge") if edge.get("function") is None]
        assert sum(len(edge.findall("lane")) for edge in edges) == len(graph.lines)
        outer = [each for each in net.findall("connection") if not each.get("from").startswith(":")]
        assert len(outer) == len(graph.links)
        inner = {lane.get("id") for edge in net.findall("edge") for lane in edge.findall("lane") if edge not in edges}
        assert {each.get("via") for each in outer if each.get("via")} == inner


def test_junctions_have_a_request_for_each_link_in_order(lake):
    """SUMO numbers the links of a junction by its incoming lanes, and the connections of each in the file's order."""
    for scenario in list(ScenarioLoader(lake))[:4]:
        net = written(scenario)["net.xml"]
        lanes = {f"{each.get('from')}_{each.get('fromLane')}": [] for each in net.findall("connection")}
        for each in net.findall("connection"):
            lanes[f"{each.get('from')}_{each.get('fromLane')}"].append(each)
        for junction in net.findall("junction"):
            links = [each for lane in junction.get("incLanes").split() for each in lanes.get(lane, ())]
            requests = junction.findall("request")
            assert [int(each.get("index")) for each in requests] == list(range(len(links)))
            targets = [(each.get("to"), each.get("toLane")) for each in links]
            for index, request in enumerate(requests):
                foes = [bit == "1" for bit in reversed(request.get("foes"))]
                assert foes == [k != index and target == targets[index] for k, target in enumerate(targets)]
                for k, bit in enumerate(reversed(request.get("response"))):
                    if foes[k]:  # one of two makes way
                        assert bit != requests[k].get("response")[len(targets) - 1 - index]
            inner = junction.get("intLanes").split()
            assert inner == [each.get("via") for each in links if each.get("via")]


def test_lights_are_programs_of_the_recorded_length(lake):
    scenario = next(each for each in ScenarioLoader(lake) if len(each.lights))
    net = written(scenario)["net.xml"]
    programs = net.findall("tlLogic")
    assert programs
    for program in programs:
        total = sum(float(phase.get("duration")) for phase in program.findall("phase"))
        assert total == pytest.approx(scenario.num_timesteps * scenario.dt, abs=1e-3 * scenario.num_timesteps)
        links = [
            int(each.get("linkIndex")) for each in net.findall("connection") if each.get("tl") == program.get("id")
        ]
        assert sorted(links) == list(range(len(links))) and links
        assert {len(phase.get("state")) for phase in program.findall("phase")} == {len(links)}


@pytest.mark.parametrize("seed", range(4))
def test_motion_is_that_of_the_front(seed):
    scenario = make_scenario(seed)
    losses = Losses()
    parts = written(scenario, losses)
    tracks = scenario.tracks
    lengths = {each.get("id"): float(each.get("length")) for each in parts["add.xml"]}
    held = np.isin(tracks.object_type, (ObjectType.VEHICLE, ObjectType.PEDESTRIAN, ObjectType.CYCLIST))
    count = 0
    for step, timestep in enumerate(parts["fcd.xml"]):
        assert float(timestep.get("time")) == pytest.approx(scenario.timestamps[step], abs=1e-3)
        for each in timestep:
            row = tracks.index(each.get("id"))
            heading = np.radians(90.0 - float(each.get("angle")))
            half = 0.5 * lengths[each.get("type")]
            centre = float(each.get("x")) - half * np.cos(heading), float(each.get("y")) - half * np.sin(heading)
            off = np.abs(np.array(centre) - tracks.position[row, step, :2]).max()
            grown = 0.5 * abs(float(tracks.size[row, step, 0]) - 2.0 * half)
            assert off < 1e-3 + grown
            assert held[row] and tracks.valid[row, step]
            count += 1
    assert count == tracks.valid[held].sum()
    told = {loss.what: loss.count for loss in losses.found()}
    seen = tracks.valid.any(axis=1)
    assert told.get("objects that are no vehicles, pedestrians or cyclists, or never seen", 0) == (~(held & seen)).sum()


def test_routes_follow_links_and_begin_where_vehicles_are_seen(lake):
    scenario = Lake(lake).loader()[0]
    parts = written(scenario)
    follows = {(each.get("from"), each.get("to")) for each in parts["net.xml"].findall("connection")}
    vehicles = parts["rou.xml"].findall("vehicle")
    assert len(vehicles) > 0.5 * len(scenario.tracks)
    departs = [float(each.get("depart")) for each in vehicles]
    assert departs == sorted(departs)  # as SUMO wants them
    lanes = {lane.get("id"): lane for lane in parts["net.xml"].iter("lane")}
    for vehicle in vehicles:
        edges = vehicle.find("route").get("edges").split()
        assert all(pair in follows for pair in itertools.pairwise(edges))
        lane = lanes[f"{edges[0]}_{vehicle.get('departLane')}"]
        points = np.array([list(map(float, point.split(",")))[:2] for point in lane.get("shape").split()])
        row = scenario.tracks.index(vehicle.get("id"))
        step = int(np.argmin(np.abs(scenario.timestamps - float(vehicle.get("depart")))))
        along = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(points, axis=0).T))])
        place = [np.interp(float(vehicle.get("departPos")), along, axis) for axis in points.T]
        assert np.hypot(*(scenario.tracks.position[row, step, :2] - place)) < 5.1


def test_ids_keep_to_what_sumo_allows(lake):
    scenario = Lake(lake).loader()[0]
    ids = scenario.tracks.ids.copy()
    ids[1], ids[2], ids[3] = "a b", "a:b", 'a"b'
    losses = Losses()
    parts = written(replace(scenario, tracks=replace(scenario.tracks, ids=ids)), losses)
    names = {each.get("id") for step in parts["fcd.xml"] for each in step}
    assert {"a_b", "a_b_", "a_b__"} <= names
    assert {loss.what: loss.count for loss in losses.found()}[
        "ids of objects with characters that SUMO does not allow"
    ] == 3


def test_scenarios_without_lanes_are_refused():
    for scenario in (small(0, has_map=False), make_scenario(0, num_lanes=0)):
        with pytest.raises(InvalidScenario, match="SUMO demands, found none"):
            writer_for("sumo").write(scenario, "scene", Losses())
