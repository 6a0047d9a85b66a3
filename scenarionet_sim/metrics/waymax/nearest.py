"""The nearest of many points that are in order along lines."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from scenarionet_data.arrays.dtypes import Float64, Int32, Int64
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


class BoxedLines(NamedTuple):
    """Points of K lines, and the boxes around these of each, as in ``PointSet``.

    Attributes:
        points, boxes, groups: Of one line after another.
        first, first_box, first_group: (K + 1,) the first of each line.
    """

    points: Float64
    boxes: Float64
    groups: Float64
    first: Int64
    first_box: Int64
    first_group: Int64

    @classmethod
    def of(cls, points: Float64, counts: Int64) -> BoxedLines:
        """Prepare the points (P, 2) [m] of lines of some lengths (K,)."""
        firsts = [np.append(0, np.cumsum(-(-counts // count))) for count in (1, _IN_BOX, _IN_BOX**2)]
        boxes, groups = (np.empty((int(first[-1]), 2, 2)) for first in firsts[1:])
        lines = cls(points, boxes, groups, *firsts)
        _bound_lines(lines)
        return lines


@kernel(allocates=False)
def _bound_lines(lines: BoxedLines) -> None:
    """Write the boxes around the points of each line."""
    for k in range(len(lines.first) - 1):
        points = lines.points[lines.first[k] : lines.first[k + 1]]
        _bound_points(points, _IN_BOX, lines.boxes[lines.first_box[k] : lines.first_box[k + 1]])
        _bound_points(points, _IN_BOX**2, lines.groups[lines.first_group[k] : lines.first_group[k + 1]])


@kernel(allocates=False)
def _bound(points: Float64, count: int, boxes: Float64) -> None:
    _bound_points(points, count, boxes)


@device_function
def _bound_points(points: Float64, count: int, boxes: Float64) -> None:
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
    """Write rows and distances."""
    last = 0
    for q in range(len(places)):
        last, square = nearest_to(places, q, points, boxes, groups, last)
        found[q], distance[q] = last, math.sqrt(square)


@device_function
def nearest_to(
    places: Float64, q: int, points: Float64, boxes: Float64, groups: Float64, guess: int
) -> tuple[int, float]:
    """Return the row of the point nearest to a place, and the square of the distance [m²].

    Boxes farther than the point of a guess, or than one found, are left out.
    """
    last, best, most = guess, np.inf, _square(places, q, points, guess)
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
    return last, best


@device_function
def nearest_row(places: Float64, q: int, points: Float64) -> tuple[int, float]:
    """Return the row of the point nearest to a place, and the square of the distance [m²], by looking at all."""
    row, best = 0, np.inf
    for p in range(len(points)):
        square = _square(places, q, points, p)
        if square < best:
            row, best = p, square
    return row, best


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
