"""Angles, paths, frames and boxes agree with simple formulas and with shapely."""

from __future__ import annotations

import itertools
import math

import numpy as np
import pytest
import shapely
import shapely.affinity
from hypothesis import example, given
from hypothesis import strategies as st

from scenarionet_data.arrays import geometry

angles = st.floats(-1e4, 1e4)
boxes = st.tuples(
    st.floats(-50, 50), st.floats(-50, 50), st.floats(-math.pi, math.pi), st.floats(0.1, 20), st.floats(0.1, 20)
)


@given(angles)
def test_wrap_angle_changes_by_full_turns(angle):
    wrapped = float(geometry.wrap_angle(angle))
    assert -math.pi <= wrapped < math.pi
    turns = (angle - wrapped) / (2 * math.pi)
    assert abs(turns - round(turns)) < 1e-9
    assert float(geometry.wrap_angle(wrapped)) == wrapped


@given(st.floats(-1e4, 1e4, width=32))
def test_wrap_angle_keeps_precision_and_the_open_bound(angle):
    pi = np.float32(np.pi)
    wrapped = geometry.wrap_angle(np.array([angle], np.float32))
    assert wrapped.dtype == np.float32
    assert -pi <= wrapped[0] < pi
    assert np.array_equal(geometry.wrap_angle(wrapped), wrapped)


def test_wrap_angle_at_its_bounds():
    for dtype in (np.float32, np.float64):
        pi = dtype(np.pi)
        assert geometry.wrap_angle(np.array([pi, -pi, 3 * pi, 0], dtype)).tolist() == pytest.approx([-pi, -pi, -pi, 0])
        below = np.nextafter(pi, dtype(0))
        assert geometry.wrap_angle(below) == below
    assert geometry.wrap_angle(7).dtype == np.float64
    assert geometry.wrap_angle(np.zeros((2, 0))).shape == (2, 0)
    assert np.isnan(geometry.wrap_angle(np.array([np.nan, np.inf, -np.inf, 4.0]))).tolist() == [True] * 3 + [False]


@given(st.lists(st.tuples(st.floats(-99, 99), st.floats(-99, 99), st.floats(-9, 9)), min_size=1, max_size=9))
def test_path_length_is_measured_in_the_plane(points):
    wanted = sum(math.dist(a[:2], b[:2]) for a, b in itertools.pairwise(points))
    assert geometry.path_length(np.array(points)) == pytest.approx(wanted)


@given(st.floats(-math.pi, math.pi), st.floats(0.1, 3))
def test_yaw_of_a_rotation_about_z(yaw, scale):
    quaternion = np.array([math.cos(yaw / 2), 0.0, 0.0, math.sin(yaw / 2)])
    found = float(geometry.yaw_from_quaternion(*quaternion))
    assert math.remainder(found - yaw, 2 * math.pi) == pytest.approx(0, abs=1e-9)
    assert float(geometry.yaw_from_quaternion(*-quaternion)) == pytest.approx(found)


@given(st.floats(-50, 50), st.floats(-50, 50), st.floats(-7, 7))
def test_rotate_matches_shapely_and_is_invertible(x, y, angle):
    turned = geometry.rotate(np.array([x, y]), angle)
    wanted = shapely.affinity.rotate(shapely.Point(x, y), angle, origin=(0, 0), use_radians=True)
    assert turned == pytest.approx([wanted.x, wanted.y], abs=1e-9)
    assert geometry.rotate(turned, -angle) == pytest.approx([x, y], abs=1e-9)


def polygon(box) -> shapely.Polygon:
    """The box by shapely's own rotation."""
    x, y, heading, length, width = box
    square = shapely.box(x - length / 2, y - width / 2, x + length / 2, y + width / 2)
    return shapely.affinity.rotate(square, heading, origin=(x, y), use_radians=True)


@given(boxes)
@example((-2.1172394064546447, 1.562, -2.1172394064546447, 19.0, 4.981036441859936))
def test_box_corners_run_counter_clockwise_from_the_front_left(box):
    x, y, heading, length, width = box
    corners = geometry.box_corners(np.array([x, y]), np.array(heading), np.array(length), np.array(width))
    outline = shapely.Polygon(corners)
    assert outline.exterior.is_ccw
    # No overlay of the two polygons: where edges differ by a rounding error, GEOS may return both boxes whole.
    assert outline.hausdorff_distance(polygon(box)) == pytest.approx(0, abs=1e-9)
    assert outline.area == pytest.approx(length * width)
    front_left = geometry.rotate(np.array([length / 2, width / 2]), heading) + np.array([x, y])
    assert corners[0] == pytest.approx(front_left)
