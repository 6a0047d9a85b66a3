"""Locations along paths: nearest point, pose at an arc length, stop points of traffic lights.

Arc lengths below 0 or beyond the end extrapolate the first or last segment; a path of one point is the straight line
along its heading.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from scenarionet_data.arrays.dtypes import Float32, Float64, Int32
from scenarionet_data.compiled.decorators import device_function, kernel
from scenarionet_sim.arrays.log import ARC, HEADING, X, Y, Z
from scenarionet_sim.arrays.minmax import larger, smaller
from scenarionet_sim.arrays.structures import OBJECTS, Recorded

_LANE_HALF = 1.75  # [m] from a lane's centreline, a path is on that lane
_BEYOND = 10.0  # [m] after a stop point, lanes that start at the same point have split


class PathRows(NamedTuple):
    """One of the paths of a world: rows ``first`` to ``end`` (exclusive) of its points.

    Attributes:
        points: (P, 5) x, y, z [m], heading [rad], arc length [m]; see ``Paths.path``.
        first, end: Rows.
    """

    points: Float32
    first: int
    end: int


@device_function
def wrapped(angle: float) -> float:
    """Wrap an angle to [-pi, pi)."""
    if abs(angle) < 3.0:
        return angle  # as nearly always, without a quotient
    return float(angle - 2.0 * np.pi * np.floor((angle + np.pi) / (2.0 * np.pi)))


@device_function
def segment_at(path: PathRows, s: float) -> int:
    """Return the first point of the segment at arc length ``s``, clamped to the first and last segment."""
    k, count = path.first, path.end - 1 - path.first
    while count > 1:
        half = count >> 1
        k += half if path.points[k + half, ARC] <= s else 0
        count -= half
    return k


@device_function
def segment_from(path: PathRows, k: int, s: float) -> int:
    """Return what :func:`segment_at` does, if that is ``k`` or a few segments further."""
    while k + 2 < path.end and path.points[k + 1, ARC] <= s:
        k += 1
    return k


@device_function
def direction(path: PathRows, k: int) -> tuple[float, float, float]:
    """Return the unit vector along segment ``k`` and its length [m]."""
    dx = np.float64(path.points[k + 1, 0]) - path.points[k, 0]
    dy = np.float64(path.points[k + 1, 1]) - path.points[k, 1]
    length = larger(np.sqrt(dx * dx + dy * dy), 1e-9)
    return dx / length, dy / length, length


@device_function
def pose_on(path: PathRows, k: int, s: float) -> tuple[float, float, float, float]:
    """Return x, y, z [m] and heading [rad] at an arc length on segment ``k``; the path has at least two points."""
    share = (s - path.points[k, ARC]) / (np.float64(path.points[k + 1, ARC]) - path.points[k, ARC])
    x = path.points[k, 0] + share * (np.float64(path.points[k + 1, 0]) - path.points[k, 0])
    y = path.points[k, 1] + share * (np.float64(path.points[k + 1, 1]) - path.points[k, 1])
    z = path.points[k, Z] + smaller(larger(share, 0.0), 1.0) * (np.float64(path.points[k + 1, Z]) - path.points[k, Z])
    turn = wrapped(np.float64(path.points[k + 1, HEADING]) - np.float64(path.points[k, HEADING]))
    return x, y, z, wrapped(path.points[k, HEADING] + share * turn)


@device_function
def nearest(path: PathRows, x: float, y: float, low: float, high: float) -> tuple[float, float]:
    """Return the arc length of the point of a path nearest to (x, y), and the offset of (x, y) to its left [m].

    Args:
        path: Of at least one point.
        x, y: The point.
        low, high: Range of arc lengths to search [m].
    """
    return nearest_from(path, x, y, segment_at(path, low), high, np.inf)


@device_function
def nearest_from(path: PathRows, x: float, y: float, start: int, high: float, limit: float) -> tuple[float, float]:
    """Return what :func:`nearest` does, from a segment on.

    Args:
        path, x, y, high: As above.
        start: First segment.
        limit: Squared distance that some of these segments keep [m²], or more; farther ones are left out quickly.
    """
    first, end = path.first, path.end
    if end - first == 1:
        cos, sin = np.cos(path.points[first, HEADING]), np.sin(path.points[first, HEADING])
        dx, dy = x - path.points[first, 0], y - path.points[first, 1]
        return cos * dx + sin * dy, cos * dy - sin * dx
    best, best_s, best_lateral = np.inf, 0.0, 0.0
    for k in range(start, end - 1):
        if path.points[k, ARC] > high:
            break
        dx, dy = x - path.points[k, 0], y - path.points[k, 1]
        if _is_farther(path, k, dx, dy, smaller(best, limit)):
            continue
        tx, ty, length = direction(path, k)
        along, left = tx * dx + ty * dy, tx * dy - ty * dx
        inside = smaller(larger(along, 0.0), length)
        over = along - inside
        apart = left * left + over * over  # "** 2" compiles for longer
        if apart < best:
            best = apart
            is_beyond = (k == first and along < 0.0) or (k == end - 2 and along > length)
            best_s = path.points[k, ARC] + (along if is_beyond else inside)
            best_lateral = left if is_beyond else np.copysign(np.sqrt(apart), left)
    return best_s, best_lateral


@device_function(forceinline=True)
def _is_farther(path: PathRows, k: int, dx: float, dy: float, limit: float) -> bool:
    """Return whether a point at (dx, dy) from the start of segment ``k`` is farther from it than the root of a limit.

    Without roots and quotients, which take most of the time; distances that are nearly equal do not count.
    """
    tx = np.float64(path.points[k + 1, 0]) - path.points[k, 0]
    ty = np.float64(path.points[k + 1, 1]) - path.points[k, 1]
    along, left, squared = tx * dx + ty * dy, tx * dy - ty * dx, tx * tx + ty * ty
    over = smaller(along, 0.0) + larger(along - squared, 0.0)
    return bool(left * left + over * over > (limit + 1e-9 * limit + 1e-9) * squared)


@kernel
def follow_paths(
    agents: Int32, motion: Float64, recorded: Recorded, back: float, ahead: float, route: Float64, sets_height: bool
) -> None:
    """Locate agents on their own paths.

    Args:
        agents: (A, 2) world and row.
        motion: (W, N, 7).
        recorded: Paths of W worlds.
        back, ahead: Search window around the last arc length [m], since a path may cross itself; the whole path
            when that is NaN.
        route: (W, N, 2) arc length and lateral offset [m], read and written at the agents.
        sets_height: Also set the agents' height in ``motion`` to the height of the path.
    """
    for a in range(len(agents)):
        w, n = agents[a, 0], agents[a, 1]
        row = recorded.place[w, OBJECTS] + n
        own = PathRows(recorded.path, recorded.path_offsets[row], recorded.path_offsets[row + 1])
        locate(own, back, ahead, motion[w, n], route[w, n], sets_height)


@kernel(allocates=False)
def locate_point(
    path: Float32, first: int, end: int, x: float, y: float, low: float, high: float
) -> tuple[float, float]:
    """Return what :func:`nearest` finds on the rows ``first`` to ``end`` of ``path``, at least one."""
    return nearest(PathRows(path, first, end), x, y, low, high)


@device_function
def locate(own: PathRows, back: float, ahead: float, row: Float64, route: Float64, sets_height: bool) -> None:
    """Locate one agent, with rows (7,) of motion and (2,) of route; see :func:`follow_paths`."""
    if own.end == own.first:
        return
    last = route[0]
    x, y, k, high, limit = row[X], row[Y], own.first, np.inf, np.inf
    if not np.isnan(last):
        k, high = segment_at(own, last), last + ahead
        dx, dy = x - own.points[k, X], y - own.points[k, Y]
        limit = dx * dx + dy * dy
        while k > own.first and own.points[k, ARC] > last - back:
            k -= 1
    route[0], route[1] = nearest_from(own, x, y, k, high, limit)
    if sets_height and own.end - own.first == 1:
        row[Z] = own.points[own.first, Z]
    elif sets_height:
        row[Z] = pose_on(own, segment_from(own, k, route[0]), route[0])[2]


@kernel(allocates=False)
def find_stops(
    path: Float32,
    path_offsets: Int32,
    lane: Int32,
    stop: Float32,
    lane_path: Float32,
    lane_offsets: Int32,
    stops: Float32,
) -> None:
    """Find where each path meets the stop point of each light that governs it.

    A light governs a path that passes its stop point and is still on its lane some metres further: lanes that
    split at a junction start at the same point but have lights of their own.

    Args:
        path, path_offsets: (P, 5), (N + 1,) paths of N objects, see ``Paths``.
        lane: (L,) row of each light's lane; -1 if the map lacks it, such a light governs no path.
        stop: (L, 2) [m], NaN if unknown.
        lane_path, lane_offsets: (Q, 5), (M + 1,) centrelines as paths; arc lengths are written here.
        stops: (N, L) of NaN; output: arc length [m] where a light governs a path.
    """
    _measure(lane_path, lane_offsets)
    for n in range(len(path_offsets) - 1):
        own = PathRows(path, path_offsets[n], path_offsets[n + 1])
        if own.end - own.first < 2:
            continue
        low_x, high_x, low_y, high_y = _bounds(own)
        for light in range(len(lane)):
            x, y, row = np.float64(stop[light, 0]), np.float64(stop[light, 1]), lane[light]
            if row < 0 or not (low_x <= x <= high_x and low_y <= y <= high_y):
                continue
            way = PathRows(lane_path, lane_offsets[row], lane_offsets[row + 1])
            if way.end - way.first > 1:
                stops[n, light] = _stop_on(own, way, x, y)


@device_function
def _measure(path: Float32, offsets: Int32) -> None:
    """Write the arc lengths of paths."""
    for m in range(len(offsets) - 1):
        for k in range(offsets[m] + 1, offsets[m + 1]):
            step = np.hypot(path[k, X] - path[k - 1, X], path[k, Y] - path[k - 1, Y])
            path[k, ARC] = path[k - 1, ARC] + larger(step, np.float32(1e-3))  # repeated points have no direction


@device_function
def _bounds(path: PathRows) -> tuple[float, float, float, float]:
    """Return min x, max x, min y, max y of a path [m], widened by half a lane."""
    low_x, high_x, low_y, high_y = np.inf, -np.inf, np.inf, -np.inf
    for k in range(path.first, path.end):
        x, y = np.float64(path.points[k, 0]), np.float64(path.points[k, 1])
        low_x, high_x, low_y, high_y = smaller(low_x, x), larger(high_x, x), smaller(low_y, y), larger(high_y, y)
    return low_x - _LANE_HALF, high_x + _LANE_HALF, low_y - _LANE_HALF, high_y + _LANE_HALF


@device_function
def _stop_on(path: PathRows, way: PathRows, x: float, y: float) -> float:
    """Return the arc length of the stop point (x, y) on a path; NaN if the path takes another lane than ``way``."""
    s, lateral = nearest(path, x, y, -np.inf, np.inf)
    beyond = smaller(_BEYOND, path.points[path.end - 1, ARC] - s)
    if abs(lateral) > _LANE_HALF or s < 0.0 or beyond < 1.0:
        return np.nan
    on_lane, _ = nearest(way, x, y, -np.inf, np.inf)
    there = smaller(larger(on_lane, 0.0) + beyond, np.float64(way.points[way.end - 1, ARC]))
    k = segment_at(way, there)
    tx, ty, _ = direction(way, k)
    x, y = way.points[k, 0] + tx * (there - way.points[k, ARC]), way.points[k, 1] + ty * (there - way.points[k, ARC])
    further, lateral = nearest(path, x, y, s, np.inf)
    return s if abs(lateral) <= _LANE_HALF and further > s else np.nan
