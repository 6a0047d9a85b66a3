"""The maximum mean discrepancy between two sets of vehicles, as TrafficGen's code computes it."""

from __future__ import annotations

import numpy as np

from scenarionet_data.arrays.dtypes import Array, Float64


def discrepancy(first: Array, second: Array) -> float:
    """Return the squared maximum mean discrepancy with one Gaussian kernel.

    As ``MMD`` in ``trafficgen/utils/evaluation.py`` of https://github.com/metadriverse/trafficgen with
    ``kernel_num=1, kernel_mul=1.0``: the width of the kernel is the mean squared distance between different rows of
    both sets, and each row is compared with itself, too. Sets of other numbers of rows may be compared as well.

    Args:
        first, second: (n, d) and (m, d) rows; m is at least 1. Without any row, the first is far from everything.

    Returns:
        0 for equal sets, and for sets whose rows are all the same.
    """
    rows: Float64 = np.concatenate([first, second]).astype(np.float64)
    square = ((rows[:, None] - rows[None]) ** 2).sum(axis=2)
    count, n = len(rows), len(first)
    width = square.sum() / max(count**2 - count, 1)
    if width == 0.0:
        return float(n == 0)
    kernel = np.exp(-square / width)
    own, other, mixed = kernel[:n, :n], kernel[n:, n:], kernel[:n, n:]
    return float(own.sum() / max(own.size, 1) + other.mean() - 2.0 * mixed.sum() / max(mixed.size, 1))
