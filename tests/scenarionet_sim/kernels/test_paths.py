"""Places along paths against shapely."""

from __future__ import annotations

import numpy as np
import pytest
import shapely
from hypothesis import given
from hypothesis import strategies as st

from scenarionet_sim.kernels.paths import follow_paths

AGENT = np.array([[0, 0]], np.int32)


def place(points, where, heading=0.0, last=np.nan, window=(10.0, 20.0)):
    """Arc length, lateral offset and height of a point on a path of one object in one world."""
    points = np.asarray(points, np.float32)
    arc = np.append(0.0, np.cumsum(np.hypot(*np.diff(points.astype(float), axis=0).T))).astype(np.float32)
    z = np.arange(len(points), dtype=np.float32)
    offsets = np.array([[0, len(points)]], np.int32)
    found = [np.full((1, 1), last), np.zeros((1, 1)), np.full((1, 1), -1.0)]
    position = np.asarray(where, float).reshape(1, 1, 2)
    paths = points[None], arc[None], np.full((1, len(points)), heading, np.float32), z[None], offsets
    follow_paths(AGENT, position, *paths, *window, *found)
    return tuple(float(value[0, 0]) for value in found)


@given(st.integers(0, 10_000))
def test_the_nearest_place_is_shapelys(seed):
    rng = np.random.default_rng(seed)
    turns = np.cumsum(rng.uniform(-0.3, 0.3, 40))
    points = np.cumsum(np.column_stack([np.cos(turns), np.sin(turns)]) * rng.uniform(0.2, 3, (40, 1)), axis=0)
    where = points[rng.integers(1, 39)] + rng.normal(0, 2, 2)
    line = shapely.LineString(points.astype(np.float32))
    wanted, point = line.project(shapely.Point(where)), shapely.Point(where)
    if 1e-6 < wanted < line.length - 1e-6:  # beyond its ends ours goes on
        s, lateral, z = place(points, where)
        assert abs(lateral) == pytest.approx(line.distance(point), abs=1e-5)
        assert line.interpolate(s).distance(point) == pytest.approx(line.distance(point), abs=1e-4)
        assert 0 <= z <= 39


def test_left_is_positive_and_ends_go_on():
    line = [[0, 0], [10, 0], [10, 10]]
    assert place(line, (4, 1.5)) == pytest.approx((4, 1.5, 0.4))
    assert place(line, (4, -1.5)) == pytest.approx((4, -1.5, 0.4))
    assert place(line, (-3, 1)) == pytest.approx((-3, 1, 0.0))
    assert place(line, (9, 13)) == pytest.approx((23, 1, 2.0))


def test_a_path_of_one_point_goes_along_its_heading():
    assert place([[5, 5]], (6, 8), heading=np.pi / 2) == pytest.approx((3, -1, 0))


def test_a_path_that_crosses_itself_is_followed_where_the_agent_was():
    loop = [[0, 0], [40, 0], [40, 20], [20, 20], [20, -20]]
    assert place(loop, (20, 0.5), last=18.0)[:2] == pytest.approx((20, 0.5))
    assert place(loop, (20.5, 0), last=95.0)[:2] == pytest.approx((100, 0.5))


def test_an_object_without_a_path_is_left_alone():
    found = np.full((1, 1), 7.0)
    empty = np.zeros((1, 0), np.float32)
    offsets = np.zeros((1, 2), np.int32)
    points = np.zeros((1, 0, 2), np.float32)
    follow_paths(AGENT, np.zeros((1, 1, 2)), points, empty, empty, empty, offsets, 1.0, 1.0, found, found, found)
    assert found[0, 0] == 7.0
