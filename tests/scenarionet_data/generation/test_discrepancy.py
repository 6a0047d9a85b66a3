"""The maximum mean discrepancy is that of TrafficGen's code, and that of sets computed by hand."""

from __future__ import annotations

import numpy as np
import pytest

from scenarionet_data.generation.discrepancy import discrepancy

REFERENCE = [
    (0, 1, 2, 1.264241099357605),
    (1, 3, 1, 0.16028404235839844),
    (2, 7, 2, 0.16747091710567474),
    (3, 12, 2, 0.13673211634159088),
    (4, 20, 1, 0.08549254387617111),
]
"""Seed, rows, columns, and what ``MMD(kernel_num=1, kernel_mul=1.0)`` of TrafficGen's ``evaluation.py`` returns."""


@pytest.mark.parametrize(("seed", "rows", "columns", "expected"), REFERENCE)
def test_equals_the_code_of_the_paper(seed, rows, columns, expected):
    rng = np.random.default_rng(seed)
    first, second = rng.normal(size=(rows, columns)) * 5, rng.normal(size=(rows, columns)) * 3 + 1
    assert discrepancy(first, second) == pytest.approx(expected, abs=1e-6)


def test_sets_of_other_sizes():
    """Rows 0, 0 and 2: squares 4 in four of nine pairs, so the width is 16 / 6."""
    near = np.exp(-4.0 * 6.0 / 16.0)
    assert discrepancy(np.zeros((2, 1)), np.full((1, 1), 2.0)) == pytest.approx(1.0 + 1.0 - 2.0 * near)


def test_equal_sets_do_not_differ():
    rows = np.arange(6.0).reshape(3, 2)
    assert discrepancy(rows, rows[::-1]) == pytest.approx(0.0, abs=1e-12)
    assert discrepancy(np.ones((2, 2)), np.ones((3, 2))) == 0.0


def test_nothing_is_far_from_everything():
    assert discrepancy(np.zeros((0, 2)), np.ones((1, 2))) == discrepancy(np.zeros((0, 2)), np.ones((3, 2))) == 1.0
    assert 0.0 < discrepancy(np.zeros((0, 2)), np.arange(6.0).reshape(3, 2)) < 1.0
