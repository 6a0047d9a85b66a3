"""The nearest of many points that are in order along lines."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from scenarionet_data.arrays.dtypes import Float64, Int32
from scenarionet_data.compiled.decorators import device_function, kernel

_IN_BOX = 16
"""Consecutive points that are left out together, if the box around them is far; and boxes around that many boxes."""


@dataclass(frozen=True, eq=False)
class PointSet:
    """Points among which the nearest are searched.

    Attributes:
        points: (P, D) [m], at least one, line by line; D is 2 or 3.
        boxes: (B, 2, 2) lower and upper corner of the box around each 16 points.
        groups: (G, 2, 2) those around each 16 boxes.
    """

    points: Float64
    boxes: Float64
    groups: Float64

    @classmethod
    def of(cls, points: Float64) -> PointSet:
        """Prepare points (P, D) [m] for a search."""
        boxes, groups = (np.empty((-(-len(points) // count), 2, 2)) for count in (_IN_BOX, _IN_BOX**2))
        _bound(points, _IN_BOX, boxes)
        _bound(points, _IN_BOX**2, groups)
        return cls(points, boxes, groups)

    def nearest(self, places: Float64) -> tuple[Int32, Float64]:
        """Return the row (Q,) of the point nearest to each place, the first of several, and the distances [m].

        Args:
            places: (Q, D) [m], best in order along a drive.
        """
        rows, distance = np.zeros(len(places), np.int32), np.empty(len(places))
        _find_nearest(places, self.points, self.boxes, self.groups, rows, distance)
        return rows, distance


@kernel(allocates=False)
def _bound(points: Float64, count: int, boxes: Float64) -> None:
    """Write the boxes around each ``count`` points."""
    for b in range(len(boxes)):
        for axis in range(2):
            lower = upper = points[b * count, axis]
            for p in range(b * count + 1, min((b + 1) * count, len(points))):
                lower, upper = min(lower, points[p, axis]), max(upper, points[p, axis])
            boxes[b, 0, axis], boxes[b, 1, axis] = lower, upper


@kernel(allocates=False)
def _find_nearest(
    places: Float64, points: Float64, boxes: Float64, groups: Float64, found: Int32, distance: Float64
) -> None:
    """Write rows and distances.

    Boxes farther than the point nearest to the place before, or than one found, are left out.
    """
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
        found[q], distance[q] = last, math.sqrt(best)


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
