"""The lane an object drives on, and the way along its successors."""

from __future__ import annotations

import numpy as np

from scenarionet_data.arrays.dtypes import Float32, Float64, Int32
from scenarionet_data.compiled.decorators import device_function, kernel
from scenarionet_sim.arrays.minmax import larger, smaller
from scenarionet_sim.arrays.structures import Lanes

_ACROSS = np.cos(np.pi / 4)  # cosine of the largest angle between a lane and an object's heading


@kernel
def find_lanes(places: Float32, headings: Float32, points: Float32, offsets: Int32, found: Float64) -> None:
    """Find the nearest lane in the direction of each pose.

    Args:
        places, headings: (Q, 2) [m], (Q,) [rad].
        points, offsets: (P, 2) [m], (M + 1,) centrelines.
        found: (Q, 3) row of the lane, arc length along it [m], distance from it [m]; written where a lane is nearer
            than the last column.
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
    """Write the nearest point of lane ``m`` to ``found`` if it is nearer than the current one."""
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
def follow_lanes(found: Float64, lanes: Lanes, spacing: float, way: Float64, count: Int32) -> None:
    """Sample points along the lanes ahead; at a split, along the lane that turns least.

    Args:
        found: (Q, 3) from :func:`find_lanes`; a row of -1 has no way.
        lanes: The map's lanes.
        spacing: Distance between points [m].
        way: (Q, K, 2) output [m]; the first point is the start.
        count: (Q,) output: number of points before the lanes end, at most K.
    """
    points, offsets = lanes.points, lanes.offsets
    for q in range(len(found)):
        count[q], m = 0, int(found[q, 0])
        arc, x, y, idle = -found[q, 1], np.nan, np.nan, 0
        while m >= 0 and idle < len(offsets):  # lanes may form cycles, even of zero length
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
            m = _straightest(lanes, m)


@device_function
def _straightest(lanes: Lanes, m: int) -> int:
    """Return the successor of lane ``m`` that turns least, or -1."""
    best, least = -1, np.inf
    for k in range(lanes.successor_offsets[m], lanes.successor_offsets[m + 1]):
        if abs(lanes.turn[lanes.successors[k]]) < least:
            best, least = int(lanes.successors[k]), abs(lanes.turn[lanes.successors[k]])
    return best
