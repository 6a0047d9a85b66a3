"""Compiled distances of WOSAC's features: between rounded boxes, to the vehicle ahead, to road edges, to lanes.

R rollouts, N objects, T steps, E evaluated objects. Frames: any, the same for objects and map; metres, radians,
seconds.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from scenarionet_data.arrays.dtypes import Array, Bool, Float32, Float64, Int64
from scenarionet_data.compiled.decorators import device_function, kernel

FAR = 1e10
"""Distance to an object that does not exist."""
MAX_TIME = 5.0
"""Largest time to collision [s], also where no object is ahead."""
_ALIGNED, _WELL_ALIGNED = math.radians(75.0), math.radians(10.0)
_SMALL_OVERLAP = 0.5
_Z_STRETCH = 3.0
BLOCK = 16
"""Segments that share a bounding box."""


@kernel(nogil=True)
def nearest_object(
    position: Float64, heading: Float64, size: Float32, valid: Bool, rows: Int64, rounding: float, distance: Float32
) -> None:
    """Find the signed distance between the box of each evaluated object and the nearest other box, corners rounded.

    Args:
        position: (R, N, T, 3) centres.
        heading: (R, N, T).
        size: (R, N, T, 3) length, width, height.
        valid: (R, N, T).
        rows: (E,) evaluated objects.
        rounding: Radius of the corners as a fraction of half the shorter side.
        distance: (R, E, T) output; FAR without another object.
    """
    for r in range(len(position)):
        for e in range(len(rows)):
            n = rows[e]
            for t in range(position.shape[2]):
                best = FAR
                if valid[r, n, t]:
                    length, width = float(size[r, n, t, 0]), float(size[r, n, t, 1])
                    radius = 0.5 * rounding * min(length, width)
                    reach = 0.5 * math.hypot(length, width)
                    cos, sin = math.cos(heading[r, n, t]), math.sin(heading[r, n, t])
                    for m in range(position.shape[1]):
                        if m == n or not valid[r, m, t]:
                            continue
                        dx = position[r, m, t, 0] - position[r, n, t, 0]
                        dy = position[r, m, t, 1] - position[r, n, t, 1]
                        other_length, other_width = float(size[r, m, t, 0]), float(size[r, m, t, 1])
                        if math.hypot(dx, dy) - reach - 0.5 * math.hypot(other_length, other_width) >= best:
                            continue
                        other_radius = 0.5 * rounding * min(other_length, other_width)
                        found = _box_distance(
                            cos * dx + sin * dy,
                            cos * dy - sin * dx,
                            heading[r, m, t] - heading[r, n, t],
                            0.5 * length - radius,
                            0.5 * width - radius,
                            0.5 * other_length - other_radius,
                            0.5 * other_width - other_radius,
                        )
                        best = min(best, found - radius - other_radius)
                distance[r, e, t] = best


@device_function
def _box_distance(x: float, y: float, turn: float, a: float, b: float, c: float, d: float) -> float:
    """Signed distance of two rectangles: the distance, or minus the shortest way to separate them.

    Args:
        x, y: Centre of the second in the frame of the first.
        turn: Its rotation.
        a, b: Half length and width of the first.
        c, d: Those of the second.
    """
    cos, sin = math.cos(turn), math.sin(turn)
    other_x, other_y = -cos * x - sin * y, sin * x - cos * y  # centre of the first in the frame of the second
    ac, as_ = abs(cos), abs(sin)
    gap = max(
        max(abs(x) - a - c * ac - d * as_, abs(y) - b - c * as_ - d * ac),
        max(abs(other_x) - c - a * ac - b * as_, abs(other_y) - d - a * as_ - b * ac),
    )
    if gap <= 0.0:
        return gap
    best = np.inf
    for i in range(4):
        u, v = (c if i & 1 else -c), (d if i & 2 else -d)
        px, py = abs(x + cos * u - sin * v) - a, abs(y + sin * u + cos * v) - b
        best = min(best, max(px, 0.0) ** 2 + max(py, 0.0) ** 2)
        u, v = (a if i & 1 else -a), (b if i & 2 else -b)
        px, py = abs(other_x + cos * u + sin * v) - c, abs(other_y - sin * u + cos * v) - d
        best = min(best, max(px, 0.0) ** 2 + max(py, 0.0) ** 2)
    return math.sqrt(best)


@kernel(nogil=True)
def time_to_object_ahead(
    position: Float64, heading: Float64, size: Float32, speed: Float64, valid: Bool, rows: Int64, time: Float32
) -> None:
    """Find the time until each evaluated object reaches the one it follows, both at constant speed.

    An object is followed if its rearmost corner is ahead of the front, if it overlaps the path sideways, and if
    headings differ by at most 75 degrees, or 10 degrees where the overlap is at most half a metre.

    Args:
        position, heading, size, valid, rows: See :func:`nearest_object`.
        speed: (R, N, T) [m/s] in the plane; NaN where unknown.
        time: (R, E, T) output, at most MAX_TIME [s].
    """
    for r in range(len(position)):
        for e in range(len(rows)):
            n = rows[e]
            for t in range(position.shape[2]):
                time[r, e, t] = MAX_TIME
                if not speed[r, n, t] > 0.0:
                    continue
                nearest, ahead = np.inf, -1
                cos, sin = math.cos(heading[r, n, t]), math.sin(heading[r, n, t])
                front, side = 0.5 * size[r, n, t, 0], 0.5 * size[r, n, t, 1]
                for m in range(position.shape[1]):
                    turn = abs(heading[r, m, t] - heading[r, n, t])
                    if not valid[r, m, t] or turn > _ALIGNED:
                        continue
                    dx = position[r, m, t, 0] - position[r, n, t, 0]
                    dy = position[r, m, t, 1] - position[r, n, t, 1]
                    ac, as_ = 0.5 * abs(math.cos(turn)), 0.5 * abs(math.sin(turn))
                    gap = cos * dx + sin * dy - front - size[r, m, t, 0] * ac - size[r, m, t, 1] * as_
                    if not 0.0 < gap < nearest:
                        continue
                    overlap = abs(cos * dy - sin * dx) - side - size[r, m, t, 0] * as_ - size[r, m, t, 1] * ac
                    if overlap < -_SMALL_OVERLAP or (overlap < 0.0 and turn <= _WELL_ALIGNED):
                        nearest, ahead = gap, m
                if ahead >= 0:
                    closing = speed[r, n, t] - speed[r, ahead, t]
                    if closing > 0.0:
                        time[r, e, t] = min(nearest / closing, MAX_TIME)


class Edges(NamedTuple):
    """Road edges.

    Attributes:
        points, offsets: (P, 3) and (K + 1,): edge k is ``points[offsets[k]:offsets[k + 1]]``; its left is the road.
        is_cyclic: (K,) whether its last point follows its first one.
        boxes: (B, 7) min x, min y, max x, max y, edge, first segment, end, of blocks of segments.
    """

    points: Float64
    offsets: Int64
    is_cyclic: Bool
    boxes: Float64


@kernel(nogil=True)
def edge_distance(
    position: Float64, heading: Float64, size: Float32, rows: Int64, edges: Edges, distance: Float32
) -> None:
    """Find the signed distance of each evaluated object's worst corner to the nearest road edge, positive off the road.

    The nearest edge is chosen with heights stretched by 3, so that edges on another level do not count; the distance
    is in the plane.

    Args:
        position, heading, size, rows: See :func:`nearest_object`.
        edges: The road edges.
        distance: (R, E, T) output.
    """
    for r in range(len(position)):
        for e in range(len(rows)):
            n = rows[e]
            hint = np.zeros(4, np.int64)
            for t in range(position.shape[2]):
                cos, sin = math.cos(heading[r, n, t]), math.sin(heading[r, n, t])
                z = position[r, n, t, 2] - 0.5 * size[r, n, t, 2]
                worst = -np.inf
                for corner in range(4):
                    u = 0.5 * size[r, n, t, 0] * (1.0 if corner < 2 else -1.0)
                    v = 0.5 * size[r, n, t, 1] * (1.0 if corner % 2 else -1.0)
                    x, y = position[r, n, t, 0] + cos * u - sin * v, position[r, n, t, 1] + sin * u + cos * v
                    found, hint[corner] = signed_distance(x, y, z, edges, hint[corner])
                    worst = max(worst, found)
                distance[r, e, t] = worst


@device_function
def signed_distance(x: float, y: float, z: float, edges: Edges, hint: int) -> tuple[float, int]:
    """Signed distance in the plane from a point to the nearest edge, negative on its left; and the block it is in.

    ``hint`` is a block likely to contain it, which is searched first.
    """
    points, offsets, is_cyclic, boxes = edges
    best, segment, block = _search(x, y, z, points, boxes[hint], np.inf, -1)
    where = hint if block else 0
    for k in range(len(boxes)):
        dx = max(max(boxes[k, 0] - x, x - boxes[k, 2]), 0.0)
        dy = max(max(boxes[k, 1] - y, y - boxes[k, 3]), 0.0)
        if k == hint or dx * dx + dy * dy > best:
            continue
        best, segment, block = _search(x, y, z, points, boxes[k], best, segment)
        if block:
            where = k
    edge = int(boxes[where, 4])
    first, last = offsets[edge], offsets[edge + 1] - 2  # its first and last segment
    share, side, flat = _beside(x, y, points, segment)
    sign = side
    if share < 0.0:
        if segment > first or is_cyclic[edge]:
            before = segment - 1 if segment > first else last
            sign = _corner_sign(points, before, segment, side, _beside(x, y, points, before)[1])
        else:
            sign = _corner_sign(points, last, segment, side, side)
    elif share > 1.0 and (segment < last or is_cyclic[edge]):
        after = segment + 1 if segment < last else first
        sign = _corner_sign(points, segment, after, side, _beside(x, y, points, after)[1])
    return sign * flat, where


@device_function
def _search(
    x: float, y: float, z: float, points: Float64, box: Float64, best: float, segment: int
) -> tuple[float, int, bool]:
    """Search a block for a segment that is nearer, or as near and earlier; squared distances in space."""
    found = False
    for k in range(int(box[5]), int(box[6])):
        ux, uy = points[k + 1, 0] - points[k, 0], points[k + 1, 1] - points[k, 1]
        dx, dy = x - points[k, 0], y - points[k, 1]
        square = ux * ux + uy * uy
        share = min(max((dx * ux + dy * uy) / square, 0.0), 1.0) if square > 0.0 else 0.0
        dx, dy = dx - share * ux, dy - share * uy
        dz = _Z_STRETCH * (z - points[k, 2] - share * (points[k + 1, 2] - points[k, 2]))
        distance = dx * dx + dy * dy + dz * dz
        if distance < best or (distance == best and k < segment):
            best, segment, found = distance, k, True
    return best, segment, found


@device_function
def _beside(x: float, y: float, points: Float64, k: int) -> tuple[float, float, float]:
    """Position along a segment (0 to 1 beside it), the side (1 right, -1 left) and the distance, in the plane."""
    ux, uy = points[k + 1, 0] - points[k, 0], points[k + 1, 1] - points[k, 1]
    dx, dy = x - points[k, 0], y - points[k, 1]
    square = ux * ux + uy * uy
    share = (dx * ux + dy * uy) / square if square > 0.0 else 0.0
    inside = min(max(share, 0.0), 1.0)
    return share, np.sign(dx * uy - dy * ux), math.hypot(dx - inside * ux, dy - inside * uy)


@device_function
def _corner_sign(points: Float64, first: int, second: int, side: float, other: float) -> float:
    """Side of a point that is nearest to the corner between two segments."""
    ux, uy = points[first + 1, 0] - points[first, 0], points[first + 1, 1] - points[first, 1]
    vx, vy = points[second + 1, 0] - points[second, 0], points[second + 1, 1] - points[second, 1]
    return max(side, other) if ux * vy - uy * vx > 0.0 else min(side, other)


@kernel(nogil=True)
def nearest_lane(
    xy: Float64, points: Float64, offsets: Int64, first: int, last: int, is_official: bool, lane: Int64, segment: Int64
) -> None:
    """Find the lane and its segment nearest to each point, in the plane.

    Args:
        xy: (Q, 2).
        points, offsets: (P, 2) and (K + 1,): lane k is ``points[offsets[k]:offsets[k + 1]]``.
        first, last: Search lanes ``first`` to ``last - 1``.
        is_official: Reproduce the owner's code: it adds the projection onto a segment instead of subtracting it, and
            continues every lane but the longest from its last point to the origin.
        lane, segment: (Q,) output; the segment counts from the lane's start.
    """
    sign, longest = (1.0 if is_official else -1.0), 0
    for k in range(len(offsets) - 1):
        longest = max(longest, offsets[k + 1] - offsets[k])
    for q in range(len(xy)):
        best = np.inf
        for k in range(first, last):
            end = offsets[k + 1]
            num_points = end - offsets[k]
            for i in range(num_points if is_official and num_points < longest else num_points - 1):
                at = offsets[k] + i
                to_x, to_y = (points[at + 1, 0], points[at + 1, 1]) if at + 1 < end else (0.0, 0.0)
                ux, uy = to_x - points[at, 0], to_y - points[at, 1]
                dx, dy = xy[q, 0] - points[at, 0], xy[q, 1] - points[at, 1]
                square = ux * ux + uy * uy
                share = min(max((dx * ux + dy * uy) / square, 0.0), 1.0) if square > 0.0 else 0.0
                dx, dy = dx + sign * share * ux, dy + sign * share * uy
                distance = dx * dx + dy * dy
                if distance < best:
                    best, lane[q], segment[q] = distance, k, i


def blocks(points: Array, offsets: Int64) -> Float64:
    """(B, 7) bounding boxes of blocks of segments for :func:`edge_distance`."""
    rows = []
    for edge in range(len(offsets) - 1):
        for first in range(offsets[edge], offsets[edge + 1] - 1, BLOCK):
            end = min(first + BLOCK, offsets[edge + 1] - 1)
            part = points[first : end + 1, :2]
            rows.append((*part.min(axis=0), *part.max(axis=0), edge, first, end))
    return np.array(rows, np.float64).reshape(-1, 7)
