"""Which of overlapping lanes an object is on, by hand."""

from __future__ import annotations

import numpy as np
import pytest

from scenarionet_data.query.lane_kernels import NearLanes, PlacedSteps, choose_lanes

SQUARE = [(0.0, 0.0), (20.0, 0.0), (20.0, 20.0), (0.0, 20.0)]
HALF = [(0.0, 0.0), (10.0, 0.0), (10.0, 20.0), (0.0, 20.0)]


def chosen(lanes, places, yaw_rate):
    """Number of the lane at each place of one object, and how far it is to the left of its centreline y = 10."""
    corners = [corner for _, _, outline in lanes for corner in outline]
    ends = np.cumsum([0, *(len(outline) for _, _, outline in lanes)])
    turns, inside = (np.array([lane[k] for lane in lanes], np.int64) for k in range(2))
    xs, ys = np.array(corners).T.copy()
    line = np.tile([(0.0, 10.0), (20.0, 10.0)], (len(lanes), 1)).T.copy()
    near = NearLanes(
        np.array([0, len(lanes)]), turns, inside, ends, xs, ys, 2 * np.arange(len(lanes) + 1), line[0], line[1]
    )
    x, y = np.array(places, float).T.copy()
    found, aside = np.full(len(x), -1), np.zeros(len(x))
    choose_lanes(PlacedSteps(np.array([0, len(x)]), x, y, np.full(len(x), yaw_rate)), near, found, aside)
    return found.tolist(), aside.tolist()


@pytest.mark.parametrize(("yaw_rate", "lane"), [(0.3, 2), (0.14, 0), (-0.14, 0), (-0.3, 1)])
def test_of_equal_lanes_in_an_intersection_it_is_on_the_one_that_turns_as_it_does(yaw_rate, lane):
    lanes = [(0, 1, SQUARE), (-1, 1, SQUARE), (1, 1, SQUARE)]
    assert chosen(lanes, [(5, 5), (15, 12)], yaw_rate) == ([lane] * 2, [-5.0, 2.0])


def test_the_lane_that_holds_most_goes_before_the_one_that_turns_so():
    """The half comes first and turns left, the square holds two of three; what is outside is on none."""
    lanes = [(1, 1, HALF), (0, 1, SQUARE)]
    assert chosen(lanes, [(5, 5), (15, 5), (25, 5)], 0.3)[0] == [1, 1, -1]
    assert chosen(lanes, [(5, 5), (6, 5)], 0.3)[0] == [0, 0]


def test_outside_intersections_lanes_do_not_turn():
    """There the first of equal lanes is taken."""
    assert chosen([(0, 0, SQUARE), (1, 0, SQUARE)], [(5, 5)], 0.3)[0] == [0]


def test_how_far_aside_is_of_the_nearest_of_all_segments():
    """Of a line that winds: each is measured here, and of those that share the nearest point the least counts."""
    rng = np.random.default_rng(6)
    line = np.cumsum(rng.normal(0, 2, (40, 2)), axis=0)
    places = line[rng.integers(0, 40, 200)] + rng.normal(0, 3, (200, 2))
    (left, low), (right, high) = line.min(axis=0) - 20, line.max(axis=0) + 20
    outline = np.array([(left, low), (right, low), (right, high), (left, high)])
    near = NearLanes(
        np.array([0, 1]), np.array([0]), np.array([0]), np.array([0, 4]), *outline.T.copy(), np.array([0, 40]),
        *line.T.copy(),
    )  # fmt: skip
    found, aside = np.full(200, -1), np.zeros(200)
    choose_lanes(PlacedSteps(np.array([0, 200]), *places.T.copy(), np.zeros(200)), near, found, aside)
    along, from_start = np.diff(line, axis=0), places[:, None] - line[:-1]
    lengths = np.linalg.norm(along, axis=1)
    share = np.clip((from_start * along).sum(axis=-1) / lengths**2, 0, 1)
    gap = np.linalg.norm(from_start - share[..., None] * along, axis=-1).round(12)
    lefts = (along[:, 0] * from_start[..., 1] - along[:, 1] * from_start[..., 0]) / lengths
    assert found.tolist() == [0] * 200
    assert aside == pytest.approx(np.where(gap == gap.min(axis=1, keepdims=True), lefts, np.inf).min(axis=1))
