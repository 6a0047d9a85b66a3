"""Paths: exact offsets, continuous headings, samples on the curve."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from scenarionet_data.procedural.path import Pose, RoadPath, bend, connect, shift, turn_around

pieces = st.lists(st.tuples(st.floats(1.0, 60.0), st.floats(-0.05, 0.05)), min_size=1, max_size=4).map(tuple)
poses = st.builds(Pose, st.floats(-100, 100), st.floats(-100, 100), st.floats(-3, 3))


@given(poses, pieces)
def test_samples_are_equally_spaced_and_end_at_the_end(start, parts):
    path = RoadPath(start, parts)
    points, headings = path.sample(2.0)
    chords = np.hypot(*np.diff(points, axis=0).T)
    assert chords.max() <= 2.0 + 1e-9
    np.testing.assert_allclose(points[-1], (path.end.x, path.end.y), atol=1e-6)
    assert headings[-1] == pytest.approx(path.end.heading)
    along = np.arctan2(*np.diff(points, axis=0).T[::-1])
    middle = (headings[1:] + headings[:-1]) / 2
    assert np.abs(np.angle(np.exp(1j * (along - middle)))).max() < 0.03


@given(poses, pieces, st.floats(-10.0, 10.0))
def test_offset_keeps_its_distance(start, parts, left):
    path = RoadPath(start, parts)
    middle, beside = path.pose_at(path.length / 2), path.offset(left)
    expected = middle.moved(0.0, left)
    found = beside.sample(0.1)[0]
    assert np.hypot(found[:, 0] - expected.x, found[:, 1] - expected.y).min() < 0.11


@given(poses, pieces)
def test_reversing_twice_is_the_identity(start, parts):
    path = RoadPath(start, parts)
    back = path.reversed().reversed()
    np.testing.assert_allclose(back.sample(2.0)[0], path.sample(2.0)[0], atol=1e-6)


@given(poses, st.floats(10.0, 50.0), st.floats(-4.0, 4.0).filter(lambda d: abs(d) > 0.1))
def test_shift_moves_sideways(start, ahead, left):
    end = RoadPath(start, shift(ahead, left)).end
    wanted = start.moved(ahead, left)
    assert math.hypot(end.x - wanted.x, end.y - wanted.y) < 1e-9
    assert end.heading == pytest.approx(start.heading)


@given(poses, st.floats(8.0, 40.0), st.floats(8.0, 40.0), st.floats(0.3, 2.5), st.sampled_from([-1, 1]))
def test_connect_reaches_the_end_pose(start, before, after, turn, side):
    corner = start.moved(before, 0.0, side * turn)
    end = corner.moved(after, 0.0)
    path = connect(start, end, lead=3.0)
    assert math.hypot(path.end.x - end.x, path.end.y - end.y) < 1e-6
    assert path.end.heading == pytest.approx(end.heading)
    assert path.pieces[0][1] == 0.0 and path.pieces[0][0] >= 3.0 - 1e-9


def test_bend_has_the_length_of_its_arc():
    assert bend(math.pi / 2, 10.0) == pytest.approx((5 * math.pi, 0.1))
    assert bend(-math.pi / 2, 10.0)[1] == -0.1


@given(poses, st.floats(2.8, 12.0), st.floats(0.0, 9.0))
def test_turning_around_reaches_the_pose_beside(start, apart, lead):
    end = start.moved(0.0, apart, math.pi)
    path = turn_around(start, end, lead, 5.0)
    assert math.hypot(path.end.x - end.x, path.end.y - end.y) < 1e-9
    assert math.cos(path.end.heading - end.heading) == pytest.approx(1.0)
    assert path.max_curvature <= 0.2 + 1e-12


def test_turning_around_swings_out_only_where_it_has_to():
    half_circle = turn_around(Pose(0.0, 0.0, 0.0), Pose(0.0, 12.0, math.pi), 8.0, 5.0)
    assert half_circle.length == pytest.approx(2 * 8.0 + math.pi * 6.0)
    narrow = turn_around(Pose(0.0, 0.0, 0.0), Pose(0.0, 3.5, math.pi), 8.0, 5.0)
    swing = math.acos(0.675)  # 2 r cos(a) - 2 r (1 - cos(a)) = 3.5 m with r = 5 m
    points = narrow.sample(0.01)[0]
    assert points[:, 1].min() == pytest.approx(-2 * 5.0 * (1 - 0.675), abs=1e-3)
    assert points[:, 0].max() == pytest.approx(8.0 + 2 * 5.0 * math.sin(swing) + 5.0, abs=1e-3)
