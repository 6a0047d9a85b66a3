"""Waymax's metrics: the values of the owner's tests, and hand-computed ones."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from scenarionet_data.building import MapBuilder
from scenarionet_data.scenario.vocabulary import MapFeatureType
from scenarionet_sim.metrics.drive import Drives, EgoDrive
from scenarionet_sim.metrics.waymax import (
    RoadEdges,
    RouteDistances,
    Routes,
    is_infeasible,
    is_offroad,
    off_route,
    overlaps,
    wrong_way,
)
from scenarionet_sim.metrics.waymax.nearest import BoxedLines
from scenarionet_sim.roads.roads import Roads


@pytest.mark.parametrize(("point", "distance"), [((3.0, 3.0, 0.0), 4.2426405), ((-1.2, 0.2, 0.0), -1.2165525)])
def test_signed_distance_to_an_edge_of_the_owner(point, distance):
    edges = RoadEdges(np.zeros((10, 3)), np.tile([0.0, 1.0], (10, 1)), np.zeros(10, np.int32))
    assert edges.signed_distance(np.array([point])) == pytest.approx([distance])


def test_edge_on_another_level_is_far():
    edges = RoadEdges(np.array([[1.0, 0, 0], [2.0, 0, 5]]), np.tile([0.0, 1.0], (2, 1)), np.arange(2, dtype=np.int32))
    assert edges.signed_distance(np.array([[1.6, 0.0, 4.0]])) == pytest.approx([-0.4])


def test_edges_of_a_map_have_the_road_on_their_left():
    builder = MapBuilder()
    builder.add("edge", MapFeatureType.ROAD_EDGE_BOUNDARY, polyline=[[0, 0], [10, 0], [10, 10]])
    edges = RoadEdges.of(Roads.from_map(builder.build(np.zeros(3))))
    assert edges.position[::10, :2].tolist() == [[0, 0], [5, 0], [10, 0], [10, 5], [10, 10]] and len(edges.edge) == 41
    found = edges.signed_distance(np.array([[9.0, 1.0, 0], [11.0, -1.0, 0], [0.0, 2.0, 0]]))
    assert found == pytest.approx([-1.0, math.sqrt(2), -2.0])
    box = np.array([[[1, 3], [-1, 3], [-1, 1], [1, 1]], [[1, 1], [-1, 1], [-1, -1], [1, -1]]], float)
    assert is_offroad(box, edges).tolist() == [False, True]


def test_overlap_ignores_absent_objects_and_touching_edges():
    position = np.array([[[0, 0], [3.9, 0], [0, 9]], [[0, 0], [4.0, 0], [0, 9]], [[0, 0], [9, 9], [0, 1]]], float)
    present = np.ones((3, 3), bool)
    arguments = position, np.zeros((3, 3)), np.tile([4.0, 2.0], (3, 1))
    assert overlaps(*arguments, present, 0).tolist() == [True, False, True]
    present[2, 2] = False
    assert overlaps(*arguments, present, 0).tolist() == [True, False, False]


@pytest.mark.parametrize(("slower", "infeasible"), [(-0.1, True), (0.1, False)])
def test_circle_of_the_owner(slower, infeasible):
    """A circle of 91 steps, driven a little slower or faster than the largest curvature allows."""
    speed = 2.0 * math.pi / 91 / 0.3 / 0.1 + slower
    heading = 2.0 * math.pi * np.arange(91) / 91 + math.pi / 2
    velocity = speed * np.column_stack((np.cos(heading), np.sin(heading)))
    assert is_infeasible(velocity, heading, 0.1).tolist() == [infeasible] * 90


def test_infeasible_motion():
    still = np.zeros(4)
    along = np.column_stack(([10.0, 11.05, 11.05, 10.0], still))
    assert is_infeasible(along, still, 0.1).tolist() == [True, False, True]
    slow = np.array([[0.5, 0.0], [0.0, 0.5]])
    assert is_infeasible(slow, np.array([0.0, 1.5]), 0.1).tolist() == [False], "too slow to tell"


def lines(*paths: tuple[list[float], bool]) -> Routes:
    """Paths of one vehicle along x, each by its x and whether it is on the route; the n-th at y = 10 n."""
    x, on = [np.array(path, float) for path, _ in paths], np.array([is_on for _, is_on in paths])
    count = np.array([len(path) for path in x])
    points = np.column_stack((np.concatenate(x), np.repeat(10.0 * np.arange(len(paths)), count)))
    listed = [(numbers, np.array([0, len(numbers)])) for numbers in (np.flatnonzero(on), np.flatnonzero(~on))]
    return Routes(BoxedLines.of(points, count), np.concatenate(x), *listed)


def along(points: list[list[float]]) -> Drives:
    position, still = np.array(points, float), np.zeros(len(points))
    return EgoDrive(0.1 * np.arange(len(points)), position, still, still, np.zeros_like(position), 4.0, 2.0, 1.2).drives


@pytest.mark.parametrize(("x", "share"), [(0.0, 0.0), (1.0, 0.5), (2.0, 1.0), (4.0, 2.0)])
def test_progression_of_the_owner(x, share):
    routes = lines(([0, 1, 2, 3, 4, 5], True), ([0, 20, 40, 60], True))
    assert routes.progression(along([[9.0, 9.0], [x, 0.0]]), along([[0.0, 0.0], [2.0, 0.0]])) == [share]


def test_progression_of_a_standing_recording_is_full():
    routes = lines(([0, 1, 2, 3], True))
    assert routes.progression(along([[3.0, 0.0]]), along([[0.0, 0.0]])) == [1.0]


def test_off_route_and_wrong_way():
    def distances(points: list[list[float]], routes: Routes) -> RouteDistances:
        return routes.distances(along(points))

    routes = lines(([0.0], True), ([0.0], False))
    found = off_route(distances([[0, 0], [0, 4.9], [0, 5.5], [0, 5.9], [0, 6.5]], routes))
    assert found.tolist() == [0.0, 0.0, 5.5, 5.9, 6.5]
    near = lines(([0.0], True))
    assert off_route(distances([[4.9, 0], [5.1, 0]], near)).tolist() == [0.0, 5.1]
    beside = replace(routes, paths=BoxedLines.of(np.array([[0.0, 0], [4.0, 0]]), np.array([1, 1])))
    assert off_route(distances([[2.9, 0], [3.1, 0]], beside)).tolist() == [0.0, 3.1], "2 m nearer to another"
    assert wrong_way(distances([[3.4, 0], [3.6, 0]], near)).tolist() == [0.0, 3.6]
