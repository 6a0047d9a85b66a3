"""Locations along paths, against shapely."""

from __future__ import annotations

import numpy as np
import pytest
import shapely
from hypothesis import given
from hypothesis import strategies as st

from scenarionet_sim.arrays.log import ARC, HEADING, X, Y, Z
from scenarionet_sim.worlds.path_kernels import follow_paths
from tests.fixtures.recorded import recorded

AGENT = np.array([[0, 0]], np.int32)


def place(points, where, heading=0.0, last=np.nan, window=(10.0, 20.0)):
    """Return arc length, lateral offset and height of a point on a path of one object in one world."""
    points = np.asarray(points, np.float32)
    path = np.zeros((1, len(points), 5), np.float32)
    path[0, :, [X, Y]], path[0, :, Z], path[0, :, HEADING] = points.T, np.arange(len(points)), heading
    path[0, 1:, ARC] = np.cumsum(np.hypot(*np.diff(points.astype(float), axis=0).T))
    motion, route = np.full((1, 1, 7), -1.0), np.array([[[last, 0.0]]])
    motion[0, 0, [X, Y]] = where
    follow_paths(AGENT, motion, recorded(path=path[0], path_offsets=[0, len(points)]), *window, route, True)
    return tuple(map(float, (*route[0, 0], motion[0, 0, Z])))


@given(st.integers(0, 10_000))
def test_nearest_point_matches_shapely(seed):
    rng = np.random.default_rng(seed)
    turns = np.cumsum(rng.uniform(-0.3, 0.3, 40))
    points = np.cumsum(np.column_stack([np.cos(turns), np.sin(turns)]) * rng.uniform(0.2, 3, (40, 1)), axis=0)
    where = points[rng.integers(1, 39)] + rng.normal(0, 2, 2)
    line = shapely.LineString(points.astype(np.float32))
    wanted, point = line.project(shapely.Point(where)), shapely.Point(where)
    if 1e-6 < wanted < line.length - 1e-6:  # ours extrapolates beyond the ends
        s, lateral, z = place(points, where)
        assert abs(lateral) == pytest.approx(line.distance(point), abs=1e-5)
        assert line.interpolate(s).distance(point) == pytest.approx(line.distance(point), abs=1e-4)
        assert 0 <= z <= 39


@given(st.integers(0, 10_000), st.floats(-50.0, 150.0))
def test_the_last_location_changes_nothing_but_the_window(seed, last):
    rng = np.random.default_rng(seed)
    points = np.cumsum(rng.normal(0, 1.5, (40, 2)), axis=0)
    where = points[rng.integers(0, 40)] + rng.choice([0.0, 2.0]) * rng.normal(size=2)
    assert place(points, where, last=last, window=(1e3, 1e3)) == place(points, where)


def test_left_is_positive_and_ends_are_extrapolated():
    line = [[0, 0], [10, 0], [10, 10]]
    assert place(line, (4, 1.5)) == pytest.approx((4, 1.5, 0.4))
    assert place(line, (4, -1.5)) == pytest.approx((4, -1.5, 0.4))
    assert place(line, (-3, 1)) == pytest.approx((-3, 1, 0.0))
    assert place(line, (9, 13)) == pytest.approx((23, 1, 2.0))


def test_path_of_one_point_is_a_line_along_its_heading():
    assert place([[5, 5]], (6, 8), heading=np.pi / 2) == pytest.approx((3, -1, 0))


def test_self_crossing_path_is_searched_near_the_last_location():
    loop = [[0, 0], [40, 0], [40, 20], [20, 20], [20, -20]]
    assert place(loop, (20, 0.5), last=18.0)[:2] == pytest.approx((20, 0.5))
    assert place(loop, (20.5, 0), last=95.0)[:2] == pytest.approx((100, 0.5))


def test_object_without_a_path_is_unchanged():
    motion, route = np.full((1, 1, 7), 7.0), np.full((1, 1, 2), 7.0)
    follow_paths(AGENT, motion, recorded(path_offsets=[0, 0]), 1.0, 1.0, route, True)
    assert (motion == 7.0).all() and (route == 7.0).all()
