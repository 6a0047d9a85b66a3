"""Places along paths: nearest points, poses at an arc length, and which traffic lights a path passes.

Arc lengths below 0 and beyond the end continue a path's first and last segment; a path of one point is the
straight line along its heading.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from scenarionet_data.arrays.compiled import device_function, kernel
from scenarionet_data.arrays.dtypes import Float32, Float64, Int32
from scenarionet_sim.kernels.minmax import larger, smaller

_LANE_HALF = 1.75  # [m] a path closer than this to a lane's centreline drives on that lane
_BEYOND = 10.0  # [m] after a stop point lanes that start together have parted by more than that


class Path(NamedTuple):
    """One path among all of a world: rows ``first`` to ``end`` of its arrays, see ``paths.Paths``."""

    points: Float32
    arc: Float32
    heading: Float32
    z: Float32
    first: int
    end: int


@device_function
def wrapped(angle: float) -> float:
    """An angle in [-pi, pi)."""
    return float(angle - 2.0 * np.pi * np.floor((angle + np.pi) / (2.0 * np.pi)))


@device_function
def segment_at(path: Path, s: float) -> int:
    """The segment that holds arc length ``s``, as its first point: the first or the last for what lies beyond."""
    low, high = path.first, path.end - 1
    while high - low > 1:
        middle = (low + high) // 2
        if path.arc[middle] <= s:
            low = middle
        else:
            high = middle
    return low


@device_function
def direction(path: Path, k: int) -> tuple[float, float, float]:
    """Unit vector along segment ``k``, and its length [m]."""
    dx = np.float64(path.points[k + 1, 0]) - path.points[k, 0]
    dy = np.float64(path.points[k + 1, 1]) - path.points[k, 1]
    length = larger(np.sqrt(dx * dx + dy * dy), 1e-9)
    return dx / length, dy / length, length


@device_function
def pose_at(path: Path, s: float) -> tuple[float, float, float, float]:
    """x, y, z [m] and heading [rad] at an arc length on a path of two points or more."""
    k = segment_at(path, s)
    share = (s - path.arc[k]) / (np.float64(path.arc[k + 1]) - path.arc[k])
    x = path.points[k, 0] + share * (np.float64(path.points[k + 1, 0]) - path.points[k, 0])
    y = path.points[k, 1] + share * (np.float64(path.points[k + 1, 1]) - path.points[k, 1])
    z = path.z[k] + smaller(larger(share, 0.0), 1.0) * (np.float64(path.z[k + 1]) - path.z[k])
    turn = wrapped(np.float64(path.heading[k + 1]) - np.float64(path.heading[k]))
    return x, y, z, wrapped(path.heading[k] + share * turn)


@device_function
def nearest(path: Path, x: float, y: float, low: float, high: float) -> tuple[float, float]:
    """Arc length of the place of a path nearest to a point, and how far to its left the point lies [m].

    Args:
        path: Of at least one point.
        x, y: The point.
        low, high: Arc lengths between which to look.
    """
    first, end = path.first, path.end
    if end - first == 1:
        cos, sin = np.cos(path.heading[first]), np.sin(path.heading[first])
        dx, dy = x - path.points[first, 0], y - path.points[first, 1]
        return cos * dx + sin * dy, cos * dy - sin * dx
    best, best_s, best_lateral = np.inf, 0.0, 0.0
    for k in range(segment_at(path, low), end - 1):
        if path.arc[k] > high:
            break
        tx, ty, length = direction(path, k)
        dx, dy = x - path.points[k, 0], y - path.points[k, 1]
        along, left = tx * dx + ty * dy, tx * dy - ty * dx
        inside = smaller(larger(along, 0.0), length)
        apart = left * left + (along - inside) ** 2
        if apart < best:
            best = apart
            is_beyond = (k == first and along < 0.0) or (k == end - 2 and along > length)
            best_s = path.arc[k] + (along if is_beyond else inside)
            best_lateral = left if is_beyond else np.copysign(np.sqrt(apart), left)
    return best_s, best_lateral


@kernel
def follow_paths(
    agents: Int32,
    position: Float64,
    points: Float32,
    arc: Float32,
    heading: Float32,
    path_z: Float32,
    offsets: Int32,
    back: float,
    ahead: float,
    along: Float64,
    lateral: Float64,
    z: Float64,
) -> None:
    """Where agents are on their own paths, and the height of the road there.

    Args:
        agents: (A, 2) world and row.
        position: (W, N, 2) [m].
        points, arc, heading, path_z, offsets: Paths of W worlds, see ``WorldBatch``.
        back, ahead: How far around the last arc length to look [m], as a path may cross itself; everywhere
            when that is NaN.
        along, lateral, z: (W, N) read and written at the agents.
    """
    for a in range(len(agents)):
        w, n = agents[a, 0], agents[a, 1]
        path = Path(points[w], arc[w], heading[w], path_z[w], offsets[w, n], offsets[w, n + 1])
        if path.end == path.first:
            continue
        last = along[w, n]
        low, high = (-np.inf, np.inf) if np.isnan(last) else (last - back, last + ahead)
        along[w, n], lateral[w, n] = nearest(path, position[w, n, 0], position[w, n, 1], low, high)
        z[w, n] = path.z[path.first] if path.end - path.first == 1 else pose_at(path, along[w, n])[2]


@kernel
def find_stops(
    points: Float32,
    arc: Float32,
    heading: Float32,
    path_z: Float32,
    offsets: Int32,
    lane: Int32,
    stop: Float32,
    lane_points: Float32,
    lane_offsets: Int32,
    stops: Float32,
) -> None:
    """Where each path meets the stop point of each light that governs it.

    A light governs a path that passes its stop point and is still on its lane some metres on: lanes that part at
    a junction start at one point and have lights of their own.

    Args:
        points, arc, heading, path_z, offsets: Paths of N objects.
        lane: (L,) row of each light's lane, -1 when the map lacks it: such a light governs no path.
        stop: (L, 2) [m], NaN when unknown.
        lane_points, lane_offsets: Centrelines.
        stops: (N, L) of NaN, written where a light governs a path: arc length [m].
    """
    lane_arc, nothing = _arcs(lane_points, lane_offsets), np.zeros(0, np.float32)
    for n in range(len(offsets) - 1):
        path = Path(points, arc, heading, path_z, offsets[n], offsets[n + 1])
        if path.end - path.first < 2:
            continue
        low_x, high_x, low_y, high_y = _bounds(path)
        for light in range(len(lane)):
            x, y, row = np.float64(stop[light, 0]), np.float64(stop[light, 1]), lane[light]
            if row < 0 or not (low_x <= x <= high_x and low_y <= y <= high_y):
                continue
            way = Path(lane_points, lane_arc, nothing, nothing, lane_offsets[row], lane_offsets[row + 1])
            if way.end - way.first > 1:
                stops[n, light] = _stop_on(path, way, x, y)


@device_function(allocates=True)
def _arcs(points: Float32, offsets: Int32) -> Float32:
    """(P,) arc lengths of all centrelines."""
    arc = np.zeros(len(points), np.float32)
    for m in range(len(offsets) - 1):
        for k in range(offsets[m] + 1, offsets[m + 1]):
            step = np.hypot(points[k, 0] - points[k - 1, 0], points[k, 1] - points[k - 1, 1])
            arc[k] = arc[k - 1] + larger(step, np.float32(1e-3))  # repeated points have no direction
    return arc


@device_function
def _bounds(path: Path) -> tuple[float, float, float, float]:
    """Least and greatest x, least and greatest y of the lane that a path drives on [m]."""
    low_x, high_x, low_y, high_y = np.inf, -np.inf, np.inf, -np.inf
    for k in range(path.first, path.end):
        x, y = np.float64(path.points[k, 0]), np.float64(path.points[k, 1])
        low_x, high_x, low_y, high_y = smaller(low_x, x), larger(high_x, x), smaller(low_y, y), larger(high_y, y)
    return low_x - _LANE_HALF, high_x + _LANE_HALF, low_y - _LANE_HALF, high_y + _LANE_HALF


@device_function
def _stop_on(path: Path, way: Path, x: float, y: float) -> float:
    """Arc length of the stop point (x, y) of a lane's light on a path, NaN when the path takes another lane."""
    s, lateral = nearest(path, x, y, -np.inf, np.inf)
    beyond = smaller(_BEYOND, path.arc[path.end - 1] - s)
    if abs(lateral) > _LANE_HALF or s < 0.0 or beyond < 1.0:
        return np.nan
    on_lane, _ = nearest(way, x, y, -np.inf, np.inf)
    there = smaller(larger(on_lane, 0.0) + beyond, np.float64(way.arc[way.end - 1]))
    k = segment_at(way, there)
    tx, ty, _ = direction(way, k)
    x, y = way.points[k, 0] + tx * (there - way.arc[k]), way.points[k, 1] + ty * (there - way.arc[k])
    further, lateral = nearest(path, x, y, s, np.inf)
    return s if abs(lateral) <= _LANE_HALF and further > s else np.nan
