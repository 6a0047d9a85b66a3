"""Cells that a border crosses, and how few points find them."""

from __future__ import annotations

from itertools import product

import numpy as np
import pytest

from scenarionet_sim.borders.lattice import MIXED, Lattice

N = 64


def found(inside, dimensions=2, monotone=(), most=100_000, cells=N):
    judged = []

    def judge(points):
        judged.extend(points)
        return [int(inside(*(np.array(point) / cells))) for point in points]

    lattice = Lattice(dimensions, cells, judge, monotone)
    step = lattice.refine(4, most)
    assert judged == lattice.tried and len(set(judged)) == len(judged)
    return lattice, step


def mixed_by_hand(inside, cells=N):
    """Every cell of a full grid whose corners differ, and the outcome of the others."""
    at = np.arange(cells + 1) / cells
    grid = np.array([[inside(x, y) for y in at] for x in at], np.int8)
    corners = np.stack([grid[i : i + cells, j : j + cells] for i, j in product((0, 1), repeat=2)])
    return np.where(corners.min(axis=0) == corners.max(axis=0), corners[0], MIXED)


@pytest.mark.parametrize(
    "inside",
    [
        lambda x, y: y < 0.3 + 0.4 * x**2,
        lambda x, y: (x - 0.4) ** 2 + (y - 0.55) ** 2 < 0.1,
        lambda x, y: y < 0.49 + 0.05 * np.sin(9 * x),  # leaves and enters coarse cells across one face
    ],
)
def test_the_border_is_that_of_a_full_grid(inside):
    lattice, step = found(inside)
    assert step == 1 and np.array_equal(lattice.regions, mixed_by_hand(inside))
    assert len(lattice.tried) <= 0.15 * (N + 1) ** 2


def test_along_a_monotone_axis_nothing_is_tried_between_equal_outcomes():
    def inside(x, y):
        return y < 0.3 + 0.4 * x**2

    all_tried, fewer = found(inside)[0], found(inside, monotone=(1,))[0]
    assert np.array_equal(all_tried.regions, fewer.regions)
    assert len(fewer.tried) < 0.8 * len(all_tried.tried)


def test_one_axis_is_bisected_and_three_are_possible():
    lattice, _ = found(lambda x: x < 0.7, dimensions=1)
    assert len(lattice.tried) == 5 + 4, "five coarse points, and one for each halving"
    assert np.flatnonzero(lattice.regions == MIXED).tolist() == [44]  # from 44 to 45 of 64 is 0.7
    lattice, _ = found(lambda x, y, z: x + y + z < 1.2, dimensions=3, cells=16)
    assert (lattice.regions[:4, :4, :4] == 1).all() and (lattice.regions[12:, 12:, 12:] == 0).all()


def test_the_budget_ends_the_search_early():
    lattice, step = found(lambda x, y: y < x, most=60)
    assert step > 1 and len(lattice.tried) <= 120
