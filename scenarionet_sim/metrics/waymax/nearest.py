"""The nearest of many points that are in order along lines."""

from __future__ import annotations

import numpy as np

from scenarionet_data.arrays.dtypes import Float64, Int32
from scenarionet_data.compiled.decorators import device_function, kernel

_IN_BOX = 16
"""Consecutive points that are left out together, if the box around them is far; and boxes around that many boxes."""


def nearest_rows(places: Float64, points: Float64) -> Int32:
    """Return the row (Q,) of the point nearest to each place, the first of several.

    Args:
        places: (Q, D) [m], best in order along a drive.
        points: (P, D) [m], at least one, line by line; D is 2 or 3.
    """
    found = np.zeros(len(places), np.int32)
    boxes = _boxes(points[:, :2], points[:, :2])
    _find_nearest(places, points, boxes, _boxes(boxes[:, 0], boxes[:, 1]), found)
    return found


def _boxes(lower: Float64, upper: Float64) -> Float64:
    """Return lower and upper corner (B, 2, 2) of the box around each 16 of some boxes, given by corners (P, 2)."""
    starts = np.arange(0, len(lower), _IN_BOX)
    return np.stack([np.minimum.reduceat(lower, starts), np.maximum.reduceat(upper, starts)], axis=1)


@kernel(allocates=False)
def _find_nearest(places: Float64, points: Float64, boxes: Float64, groups: Float64, found: Int32) -> None:
    """Write the rows; boxes farther than the point nearest to the place before, or than one found, are left out."""
    last = 0
    for q in range(len(places)):
        best, most = np.inf, _square(places, q, points, last)
        for g in range(len(groups)):
            if not _is_reached(places, q, groups, g, most, best):
                continue
            for b in range(_IN_BOX * g, min(_IN_BOX * (g + 1), len(boxes))):
                if not _is_reached(places, q, boxes, b, most, best):
                    continue
                for p in range(_IN_BOX * b, min(_IN_BOX * (b + 1), len(points))):
                    square = _square(places, q, points, p)
                    if square < best:
                        best, last = square, p
        found[q] = last


@device_function(forceinline=True)
def _is_reached(places: Float64, q: int, boxes: Float64, b: int, most: float, best: float) -> bool:
    """Return whether a box may have a point as near as ``most`` and nearer than ``best`` [m²]."""
    outside = 0.0
    for axis in range(2):
        away = max(boxes[b, 0, axis] - places[q, axis], places[q, axis] - boxes[b, 1, axis], 0.0)
        outside += away * away
    return outside <= most and outside < best


@device_function(forceinline=True)
def _square(places: Float64, q: int, points: Float64, p: int) -> float:
    """Return the square of the distance between a place and a point."""
    square = 0.0
    for axis in range(places.shape[1]):
        away = points[p, axis] - places[q, axis]
        square += away * away
    return square
