"""The nearest of many points that are in order along lines."""

from __future__ import annotations

import numpy as np

from scenarionet_data.arrays.compiled import device_function, kernel
from scenarionet_data.arrays.dtypes import Float64, Int32

_IN_BOX = 32
"""Consecutive points that are left out together, if the box around them is far."""


def nearest_rows(places: Float64, points: Float64) -> Int32:
    """Return the row (Q,) of the point nearest to each place, the first of several.

    Args:
        places: (Q, D) [m], best in order along a drive.
        points: (P, D) [m], at least one, line by line; D is 2 or 3.
    """
    found, first = np.zeros(len(places), np.int32), np.arange(0, len(points), _IN_BOX)
    _find_nearest(places, points, np.minimum.reduceat(points, first), np.maximum.reduceat(points, first), found)
    return found


@kernel(allocates=False)
def _find_nearest(places: Float64, points: Float64, lower: Float64, upper: Float64, found: Int32) -> None:
    """Write the rows; boxes farther than the point nearest to the place before, or than one found, are left out."""
    last = 0
    for q in range(len(places)):
        best, most = np.inf, _square(places, q, points, last)
        for b in range(len(lower)):
            outside = 0.0
            for axis in range(2):
                away = max(lower[b, axis] - places[q, axis], places[q, axis] - upper[b, axis], 0.0)
                outside += away * away
            if outside > most or outside >= best:
                continue
            for p in range(_IN_BOX * b, min(_IN_BOX * (b + 1), len(points))):
                square = _square(places, q, points, p)
                if square < best:
                    best, last = square, p
        found[q] = last


@device_function(forceinline=True)
def _square(places: Float64, q: int, points: Float64, p: int) -> float:
    """Return the square of the distance between a place and a point."""
    square = 0.0
    for axis in range(places.shape[1]):
        away = points[p, axis] - places[q, axis]
        square += away * away
    return square
