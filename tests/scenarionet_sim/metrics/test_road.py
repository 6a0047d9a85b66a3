"""Traffic rules on a straight road of two lanes, one in each direction."""

from __future__ import annotations

import numpy as np
import pytest

from scenarionet_data.building import MapBuilder
from scenarionet_data.scenario.vocabulary import MapFeatureType
from scenarionet_sim.metrics.results.red_lights import runs_red_light
from scenarionet_sim.metrics.road import is_off_road
from scenarionet_sim.roads.roads import Roads


@pytest.fixture(scope="module")
def roads() -> Roads:
    builder = MapBuilder()
    for name, points in (("east", [[0, 0], [50, 0], [100, 0]]), ("west", [[100, 3.5], [0, 3.5]])):
        builder.add(name, MapFeatureType.LANE_SURFACE_STREET, polyline=points, width=[[1.75, 1.75]])
    return Roads.from_map(builder.build(np.zeros(3)))


def box(x: float, y: float) -> list[list[float]]:
    return [[x + 2, y + 1], [x + 2, y - 1], [x - 2, y - 1], [x - 2, y + 1]]


def test_off_road_by_more_than_the_tolerance(roads):
    """The road reaches from y = -1.75 to 5.25; a corner may be 0.3 m beside it."""
    corners = np.array([box(50, 0), box(50, 1.75), box(50, -1.0), box(50, -1.1), box(50, 4.5), box(130, 0)])
    assert is_off_road(corners, roads).tolist() == [False, False, False, True, False, True]


def drive(x: np.ndarray, y: float) -> np.ndarray:
    return np.column_stack((x, np.full(len(x), y))).astype(np.float64)


def test_the_road_goes_on_where_the_map_ends(roads):
    """The lane to the east ends at x = 100, the one to the west begins there."""
    ends = np.array([box(99, 0), box(107, 0), box(113, 0), box(99, 3.5), box(-1, 0), box(99, -3.0)])
    assert is_off_road(ends, roads).tolist() == [False, False, True, False, False, True]
    tolerated = np.array([box(99, 0), box(108.2, 0), box(108.4, 0)])  # fronts 10.2 and 10.4 m behind the end
    assert is_off_road(tolerated, roads).tolist() == [False, False, True]


def test_red_light():
    position = drive(np.array([0.0, 4.0, 8.0, 12.0]), 0.5)
    stop, direction = np.array([[6.0, 0.0]]), np.array([[1.0, 0.0]])
    red = np.ones((1, 4), bool)
    assert runs_red_light(position, stop, direction, red).tolist() == [True]
    assert runs_red_light(position, stop, -direction, red).tolist() == [False], "the light of the other direction"
    assert runs_red_light(position + np.array([0, 3.0]), stop, direction, red).tolist() == [False], "the lane beside"
    assert runs_red_light(position[:2], stop, direction, red[:, :2]).tolist() == [False], "stops before it"
    red[0, 2] = False
    assert runs_red_light(position, stop, direction, red).tolist() == [False], "green when it passes"
    none = runs_red_light(position, np.zeros((0, 2)), np.zeros((0, 2)), np.zeros((0, 4), bool))
    assert none.tolist() == []
