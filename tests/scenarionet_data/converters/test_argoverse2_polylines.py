"""Batched polyline arithmetic agrees with processing each line separately."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from scenarionet_data.arrays.ragged import Ragged
from scenarionet_data.building.polylines import midlines, points_at, positions_along
from scenarionet_data.converters.argoverse2.polylines import ground_height, outline, road_edges

seeds = st.integers(0, 2**32 - 1)


def lines(seed: int, count: int = 5) -> Ragged:
    rng = np.random.default_rng(seed)
    lengths = rng.integers(2, 8, count)
    steps = rng.uniform(-3.0, 10.0, (lengths.sum(), 3))
    return Ragged.from_flat(lengths.tolist(), np.cumsum(steps, axis=0) + 1e5)


@given(seeds)
def test_every_point_is_projected_onto_its_line(seed: int) -> None:
    some = lines(seed)
    np.testing.assert_allclose(points_at(some, positions_along(some)), some.values, atol=1e-6)


@given(seeds, st.integers(0, 4), st.floats(0.0, 1.0))
def test_resampled_points_match_the_single_line(seed: int, row: int, share: float) -> None:
    some = lines(seed)
    line = some[row]
    travelled = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(line[:, :2], axis=0).T))])
    wanted = [np.interp(share * travelled[-1], travelled, line[:, axis]) for axis in range(3)]
    np.testing.assert_allclose(points_at(some, np.array([2.0 * row + share]))[0], wanted, atol=1e-6)


def test_degenerate_line_does_not_affect_the_others() -> None:
    points = np.array([[0, 0, 0], [4, 0, 1], [7, 7, 7], [7, 7, 7], [7, 7, 9], [0, 1, 0], [0, 5, 0]], float)
    some = Ragged.from_flat([2, 3, 2], points)
    np.testing.assert_allclose(positions_along(some), [0, 1, 2, 2.5, 3, 4, 5])
    np.testing.assert_allclose(points_at(some, np.array([2.25, 4.5])), [[7, 7, 7], [0, 3, 0]])


def test_midlines_are_halfway_between() -> None:
    left = Ragged.from_flat([2, 2], np.array([[0, 2, 1], [9, 2, 1], [0, 0, 0], [0, 1, 0]], float))
    right = Ragged.from_flat([3, 2], np.array([[0, -2, 3], [1, -2, 3], [9, -2, 3], [1, 0, 0], [1, 1, 0]], float))
    middle = midlines(left, right)
    assert middle.lengths.tolist() == [6, 2]
    np.testing.assert_allclose(middle[0], np.column_stack([np.linspace(0, 9, 6), np.zeros(6), np.full(6, 2.0)]))
    np.testing.assert_allclose(middle[1], [[0.5, 0, 0], [0.5, 1, 0]])


@given(seeds)
def test_ground_height_is_bounded_by_its_points_and_close_to_the_nearest(seed: int) -> None:
    rng = np.random.default_rng(seed)
    xy = rng.uniform(-60.0, 60.0, (1500, 2)) + 3000.0
    slope = rng.uniform(-0.1, 0.1, 2)
    ground = np.column_stack([xy, (xy - 3000.0) @ slope + 500.0])
    places = rng.uniform(-40.0, 40.0, (200, 2)) + 3000.0
    height = ground_height(ground, places)
    assert (height >= ground[:, 2].min()).all()
    assert (height <= ground[:, 2].max()).all()
    np.testing.assert_allclose(height, (places - 3000.0) @ slope + 500.0, atol=0.3)


SQUARE = np.array([[1.0, 1, 0], [30, 1, 0], [30, 20, 0], [1, 20, 0]])


@pytest.mark.parametrize("points", [SQUARE, SQUARE[::-1], np.concatenate([SQUARE, SQUARE[:1]])])
def test_outlines_are_open_and_counter_clockwise(points: np.ndarray) -> None:
    ring = outline(points)
    assert len(ring) == 4
    x, y = ring[:, 0], ring[:, 1]
    assert (x * np.roll(y, -1) - y * np.roll(x, -1)).sum() > 0


def test_single_area_is_all_edge() -> None:
    ((edge,),) = road_edges([SQUARE * 0.9])
    assert edge.shape == (5, 3)
    np.testing.assert_array_equal(edge[0], edge[-1])


def test_tile_boundary_is_not_an_edge() -> None:
    ((edge,),) = road_edges([SQUARE])
    np.testing.assert_array_equal(edge, SQUARE[[2, 3, 0, 1]])


def test_side_shared_by_two_areas_is_not_an_edge() -> None:
    left = np.array([[0.5, 1, 0], [7, 1, 0], [7.5, 9, 0], [0.5, 9, 0]])
    right = np.array([[7.0, 1, 0], [14, 1, 0], [14, 9, 0], [7.5, 9, 0]])
    (first,), (second,) = road_edges([left, right])
    np.testing.assert_array_equal(first, left[[2, 3, 0, 1]])
    np.testing.assert_array_equal(second, right)
    assert road_edges([]) == []
