"""Detection of intersections in maps that do not mark them: lanes that cross near the ego's path."""

from __future__ import annotations

import numpy as np

from scenarionet_data.arrays.dtypes import Array
from scenarionet_data.compiled.decorators import device_function, kernel
from scenarionet_data.scenario import vocabulary
from scenarionet_data.scenario.description import MapFeatures

_SAME_PLACE = 1e-6
"""Metres from a lane's end within which lanes touch there and do not cross."""


def lanes_cross_near(features: MapFeatures, path: Array, distance: float, angle: float) -> bool:
    """Whether two lanes with different predecessors cross close to a path.

    Args:
        features: The map.
        path: (n, 2) [m] in the map's frame.
        distance: How far from the path a crossing counts [m].
        angle: Smallest angle between the lanes that counts as crossing [rad].
    """
    lower, upper = features.polyline.bounds()
    meets = (lower[:, :2] <= path.max(axis=0) + distance) & (upper[:, :2] >= path.min(axis=0) - distance)
    rows = np.flatnonzero(
        meets.all(axis=1) & vocabulary.is_lane(features.feature_type) & (features.polyline.lengths > 1)
    )
    if len(rows) < 2:
        return False
    lanes, entries = features.polyline.take(rows), features.entry_lanes.take(rows)
    numbers: dict[str, int] = {}
    entry = np.array([numbers.setdefault(lane, len(numbers)) for lane in entries.values], np.int64)
    points = np.ascontiguousarray(lanes.values[:, :2], dtype=np.float64)
    low, high = np.minimum.reduceat(points, lanes.offsets[:-1]), np.maximum.reduceat(points, lanes.offsets[:-1])
    boxes = np.stack([low, high])
    return bool(_any_crossing(points, lanes.offsets, boxes, entry, entries.offsets, path, distance, np.sin(angle)))


@kernel
def _any_crossing(
    points: Array,
    first: Array,
    boxes: Array,
    entry: Array,
    first_entry: Array,
    path: Array,
    distance: float,
    least_sine: float,
) -> bool:
    """Test all pairs of segments of lanes whose boxes overlap, up to the first crossing that counts.

    Args:
        points: (P, 2) of all lanes; lane ``k`` has those from ``first[k]`` to ``first[k + 1]``.
        first: (M + 1,).
        boxes: (2, M, 2) lower and upper corners of the lanes' boxes.
        entry: Predecessors as numbers, lane ``k`` those from ``first_entry[k]`` to ``first_entry[k + 1]``.
        first_entry: (M + 1,).
        path: (n, 2).
        distance: How far from the path a crossing counts [m].
        least_sine: Of the smallest angle that counts.
    """
    num_lanes, low, high = len(first) - 1, boxes[0], boxes[1]
    for a in range(num_lanes):
        for b in range(a + 1, num_lanes):
            if low[a, 0] > high[b, 0] or low[b, 0] > high[a, 0] or low[a, 1] > high[b, 1] or low[b, 1] > high[a, 1]:
                continue
            if _share(entry[first_entry[a] : first_entry[a + 1]], entry[first_entry[b] : first_entry[b + 1]]):
                continue
            one, other = points[first[a] : first[a + 1]], points[first[b] : first[b + 1]]
            if _is_crossed(one, other, low[b], high[b], path, distance, least_sine):
                return True
    return False


@device_function
def _share(one: Array, other: Array) -> bool:
    for left in one:
        for right in other:
            if left == right:
                return True
    return False


@device_function
def _is_crossed(
    one: Array, other: Array, low: Array, high: Array, path: Array, distance: float, least_sine: float
) -> bool:
    """Whether two lanes cross near the path; ``low`` and ``high`` are the corners of the other's box."""
    for i in range(len(one) - 1):
        px, py, qx, qy = one[i, 0], one[i, 1], one[i + 1, 0], one[i + 1, 1]
        if max(px, qx) < low[0] or min(px, qx) > high[0] or max(py, qy) < low[1] or min(py, qy) > high[1]:
            continue
        for j in range(len(other) - 1):
            rx, ry, sx, sy = other[j, 0], other[j, 1], other[j + 1, 0], other[j + 1, 1]
            # A point on the other's line counts as to its left, so that a vertex is crossed once.
            r_left = (qx - px) * (ry - py) - (qy - py) * (rx - px)
            s_left = (qx - px) * (sy - py) - (qy - py) * (sx - px)
            if (r_left >= 0) == (s_left >= 0):
                continue
            p_left = (sx - rx) * (py - ry) - (sy - ry) * (px - rx)
            q_left = (sx - rx) * (qy - ry) - (sy - ry) * (qx - rx)
            if (p_left >= 0) == (q_left >= 0):
                continue
            sine = abs(r_left - s_left) / np.sqrt(((qx - px) ** 2 + (qy - py) ** 2) * ((sx - rx) ** 2 + (sy - ry) ** 2))
            share = p_left / (p_left - q_left)
            x, y = px + share * (qx - px), py + share * (qy - py)
            is_inside = not (_is_end(one, x, y) or _is_end(other, x, y))
            if sine > least_sine and is_inside and _is_near(path, x, y, distance):
                return True
    return False


@device_function
def _is_end(line: Array, x: float, y: float) -> bool:
    last = len(line) - 1
    at_start = abs(line[0, 0] - x) < _SAME_PLACE and abs(line[0, 1] - y) < _SAME_PLACE
    return bool(at_start or (abs(line[last, 0] - x) < _SAME_PLACE and abs(line[last, 1] - y) < _SAME_PLACE))


@device_function
def _is_near(path: Array, x: float, y: float, distance: float) -> bool:
    """Whether a point is at most ``distance`` from a path, which may be a single point."""
    for k in range(max(len(path) - 1, 1)):
        end = min(k + 1, len(path) - 1)
        along_x, along_y = path[end, 0] - path[k, 0], path[end, 1] - path[k, 1]
        away_x, away_y = x - path[k, 0], y - path[k, 1]
        length = along_x * along_x + along_y * along_y
        share = 0.0
        if length > 0.0:
            share = min(max((away_x * along_x + away_y * along_y) / length, 0.0), 1.0)
        if np.hypot(away_x - share * along_x, away_y - share * along_y) <= distance:
            return True
    return False
