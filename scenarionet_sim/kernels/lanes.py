"""Which lane an object drives on, and where the lanes lead from there."""

from __future__ import annotations

import numpy as np

from scenarionet_data.arrays.compiled import device_function, kernel
from scenarionet_data.arrays.dtypes import Float32, Float64, Int32
from scenarionet_sim.kernels.minmax import larger, smaller

_ACROSS = np.cos(np.pi / 4)  # how far a lane's direction may be from an object's heading


@kernel
def find_lanes(places: Float32, headings: Float32, points: Float32, offsets: Int32, found: Float64) -> None:
    """The lane nearest to each place that leads its way.

    Args:
        places, headings: (Q, 2) [m], (Q,) [rad].
        points, offsets: (P, 2) [m], (M + 1,) centrelines.
        found: (Q, 3) row of the lane, how far along it the place is [m], how far from it; written where a lane
            is nearer than what the last column says.
    """
    box = np.empty(4)
    for m in range(len(offsets) - 1):
        box[:2], box[2:] = np.inf, -np.inf
        for k in range(offsets[m], offsets[m + 1]):
            for axis in range(2):
                box[axis] = smaller(box[axis], np.float64(points[k, axis]))
                box[2 + axis] = larger(box[2 + axis], np.float64(points[k, axis]))
        for q in range(len(places)):
            x, y, reach = np.float64(places[q, 0]), np.float64(places[q, 1]), found[q, 2]
            if box[0] - reach < x < box[2] + reach and box[1] - reach < y < box[3] + reach:
                _look_on(m, x, y, np.float64(headings[q]), points, offsets[m], offsets[m + 1], found[q])


@device_function
def _look_on(m: int, x: float, y: float, heading: float, points: Float32, first: int, end: int, found: Float64) -> None:
    """Write to ``found`` the place of lane ``m`` nearest to a point, if it is nearer than what is there."""
    cos, sin, arc = np.cos(heading), np.sin(heading), 0.0
    for k in range(first, end - 1):
        tx, ty = np.float64(points[k + 1, 0]) - points[k, 0], np.float64(points[k + 1, 1]) - points[k, 1]
        length = np.sqrt(tx * tx + ty * ty)
        dx, dy = x - points[k, 0], y - points[k, 1]
        if length > 0.0 and abs(tx * dy - ty * dx) < found[2] * length and cos * tx + sin * ty > _ACROSS * length:
            along = smaller(larger((tx * dx + ty * dy) / length, 0.0), length)
            apart = np.hypot(dx - along * tx / length, dy - along * ty / length)
            if apart < found[2]:
                found[0], found[1], found[2] = m, arc + along, apart
        arc += length


@kernel
def follow_lanes(
    found: Float64,
    points: Float32,
    offsets: Int32,
    successors: Int32,
    successor_offsets: Int32,
    turn: Float64,
    spacing: float,
    way: Float64,
    count: Int32,
) -> None:
    """Points along the lanes ahead; where lanes part, along the one that turns least.

    Args:
        found: (Q, 3) as of ``find_lanes``; nothing follows from a row below 0.
        points, offsets: (P, 2) [m], (M + 1,) centrelines.
        successors, successor_offsets: Rows of the lanes that follow each, (M + 1,) where they begin.
        turn: (M,) by how much each lane turns [rad].
        spacing: Between points [m].
        way: (Q, K, 2) written: [m], the first point is the place itself.
        count: (Q,) written: how many points there are before the lanes end, at most K.
    """
    for q in range(len(found)):
        count[q], m = 0, int(found[q, 0])
        arc, x, y, idle = -found[q, 1], np.nan, np.nan, 0
        while m >= 0 and idle < len(offsets):  # lanes may lead in circles, also in such as have no length
            before = arc
            for k in range(offsets[m], offsets[m + 1]):
                length = 0.0 if np.isnan(x) else np.hypot(points[k, 0] - x, points[k, 1] - y)
                while count[q] < way.shape[1] and length > 0.0 and spacing * count[q] <= arc + length:
                    share = (spacing * count[q] - arc) / length
                    way[q, count[q], 0] = x + share * (points[k, 0] - x)
                    way[q, count[q], 1] = y + share * (points[k, 1] - y)
                    count[q] += 1
                arc, x, y = arc + length, np.float64(points[k, 0]), np.float64(points[k, 1])
            if count[q] == way.shape[1]:
                break
            idle = idle + 1 if arc == before else 0
            m = _straightest(successors, successor_offsets[m], successor_offsets[m + 1], turn)


@device_function
def _straightest(successors: Int32, first: int, end: int, turn: Float64) -> int:
    """The successor that turns least; -1 without any."""
    best, least = -1, np.inf
    for k in range(first, end):
        if abs(turn[successors[k]]) < least:
            best, least = int(successors[k]), abs(turn[successors[k]])
    return best
