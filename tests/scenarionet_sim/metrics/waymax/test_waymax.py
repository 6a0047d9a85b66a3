"""Waymax's metrics: the values of the owner's tests, and hand-computed ones."""

from __future__ import annotations

import math

import numpy as np
import pytest

from scenarionet_data.building import MapBuilder
from scenarionet_data.scenario.vocabulary import MapFeatureType
from scenarionet_sim.metrics.waymax import (
    RoadEdges,
    RouteDistances,
    Routes,
    is_infeasible,
    is_offroad,
    off_route,
    overlaps,
    progression,
    wrong_way,
)
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
    """Paths along x, each by its x and whether it is on the route; the n-th at y = 10 n."""
    x, on = [np.array(path) for path, _ in paths], [is_on for _, is_on in paths]
    count = [len(path) for path in x]
    y = np.repeat(10.0 * np.arange(len(paths)), count)
    number = np.repeat(np.arange(len(paths), dtype=np.int32), count)
    return Routes(np.column_stack((np.concatenate(x), y)), np.concatenate(x), number, np.repeat(on, count))


@pytest.mark.parametrize(("x", "share"), [(0.0, 0.0), (1.0, 0.5), (2.0, 1.0), (4.0, 2.0)])
def test_progression_of_the_owner(x, share):
    routes = lines(([0, 1, 2, 3, 4, 5], True), ([0, 20, 40, 60], True))
    assert progression(np.array([x, 0.0]), np.zeros(2), np.array([2.0, 0.0]), routes) == share


def test_progression_of_a_standing_recording_is_full():
    assert progression(np.array([3.0, 0.0]), np.zeros(2), np.zeros(2), lines(([0, 1, 2, 3], True))) == 1.0


def test_off_route_and_wrong_way():
    def distances(points: list[list[float]], routes: Routes) -> RouteDistances:
        return RouteDistances.of(np.array(points, float), routes)

    routes = lines(([0.0], True), ([0.0], False))
    found = off_route(distances([[0, 0], [0, 4.9], [0, 5.5], [0, 5.9], [0, 6.5]], routes))
    assert found.tolist() == [0.0, 0.0, 5.5, 5.9, 6.5]
    near = lines(([0.0], True))
    assert off_route(distances([[4.9, 0], [5.1, 0]], near)).tolist() == [0.0, 5.1]
    beside = Routes(np.array([[0.0, 0], [4.0, 0]]), np.zeros(2), np.arange(2, dtype=np.int32), np.array([True, False]))
    assert off_route(distances([[2.9, 0], [3.1, 0]], beside)).tolist() == [0.0, 3.1], "2 m nearer to another"
    assert wrong_way(distances([[3.4, 0], [3.6, 0]], near)).tolist() == [0.0, 3.6]
