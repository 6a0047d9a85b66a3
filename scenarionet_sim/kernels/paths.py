"""Places along paths: nearest points, poses at an arc length, and which traffic lights a path passes.

A path is ``points[first:end]`` (P, 2) with arc lengths ``arc[first:end]`` that start at 0. Arc lengths below 0 and
beyond the end continue the first and last segment; a path of one point is the straight line along its heading.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from scenarionet_data.procedural.jit import entry, part

Bool = npt.NDArray[np.bool_]
Float32 = npt.NDArray[np.float32]
Float64 = npt.NDArray[np.float64]
Int32 = npt.NDArray[np.int32]

_LANE_HALF = 1.75  # [m] a path closer than this to a lane's centreline drives on that lane
_BEYOND = 10.0  # [m] after a stop point lanes that start together have parted by more than that


@part
def segment_at(arc: Float32, first: int, end: int, s: float) -> int:
    """The segment that holds arc length ``s``: from its returned point to the next; ``end - 2`` beyond the end."""
    low, high = first, end - 1
    while high - low > 1:
        middle = (low + high) // 2
        if arc[middle] <= s:
            low = middle
        else:
            high = middle
    return low


@part
def nearest(
    points: Float32, arc: Float32, heading: Float32, first: int, end: int, x: float, y: float, low: float, high: float
) -> tuple[float, float]:
    """Arc length of the place of a path nearest to a point, and how far to its left the point lies [m].

    Args:
        points, arc, heading: Paths of one world.
        first, end: The path; at least one point.
        x, y: The point.
        low, high: Arc lengths between which to look.
    """
    if end - first == 1:
        cos, sin = np.cos(heading[first]), np.sin(heading[first])
        dx, dy = x - points[first, 0], y - points[first, 1]
        return cos * dx + sin * dy, cos * dy - sin * dx
    best, best_s, best_lateral = np.inf, 0.0, 0.0
    for k in range(segment_at(arc, first, end, low), end - 1):
        if arc[k] > high:
            break
        length = arc[k + 1] - arc[k]
        x0, y0 = np.float64(points[k, 0]), np.float64(points[k, 1])
        tx, ty = (points[k + 1, 0] - x0) / length, (points[k + 1, 1] - y0) / length
        dx, dy = x - x0, y - y0
        along, left = tx * dx + ty * dy, tx * dy - ty * dx
        inside = min(max(along, 0.0), np.float64(length))
        apart = left * left + (along - inside) ** 2
        if apart < best:
            best = apart
            is_beyond = (k == first and along < 0.0) or (k == end - 2 and along > length)
            best_s = arc[k] + (along if is_beyond else inside)
            best_lateral = left if is_beyond else np.copysign(np.sqrt(apart), left)
    return best_s, best_lateral


@entry
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
        points, arc, heading, path_z, offsets: Paths of W worlds, see ``Stage``.
        back, ahead: How far around the last arc length to look [m], as a path may cross itself; everywhere
            when that is NaN.
        along, lateral, z: (W, N) read and written at the agents.
    """
    for a in range(len(agents)):
        w, n = agents[a, 0], agents[a, 1]
        first, end = offsets[w, n], offsets[w, n + 1]
        if end == first:
            continue
        x, y, last = position[w, n, 0], position[w, n, 1], along[w, n]
        low, high = (-np.inf, np.inf) if np.isnan(last) else (last - back, last + ahead)
        found = nearest(points[w], arc[w], heading[w], first, end, x, y, low, high)
        along[w, n], lateral[w, n] = found
        z[w, n] = height_at(arc[w], path_z[w], first, end, found[0])


@part
def height_at(arc: Float32, path_z: Float32, first: int, end: int, s: float) -> float:
    """Height of a path at an arc length [m]; that of its ends beyond them."""
    if end - first == 1:
        return float(path_z[first])
    k = segment_at(arc, first, end, s)
    share = min(max((s - arc[k]) / (arc[k + 1] - arc[k]), 0.0), 1.0)
    return float(path_z[k] + share * (path_z[k + 1] - path_z[k]))


@entry
def find_stops(
    points: Float32,
    arc: Float32,
    heading: Float32,
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
        points, arc, heading, offsets: Paths of N objects.
        lane: (L,) row of each light's lane, -1 when the map lacks it: such a light governs no path.
        stop: (L, 2) [m], NaN when unknown.
        lane_points, lane_offsets: Centrelines.
        stops: (N, L) written: arc lengths, NaN where the light does not govern the path.
    """
    lane_arc, zeros = np.zeros(len(lane_points), np.float32), np.zeros(len(lane_points), np.float32)
    for m in range(len(lane_offsets) - 1):
        for k in range(lane_offsets[m] + 1, lane_offsets[m + 1]):
            step = np.hypot(lane_points[k, 0] - lane_points[k - 1, 0], lane_points[k, 1] - lane_points[k - 1, 1])
            lane_arc[k] = lane_arc[k - 1] + max(step, np.float32(1e-6))  # repeated points have no direction
    for n in range(len(offsets) - 1):
        first, end = offsets[n], offsets[n + 1]
        if end - first < 2:
            continue
        low_x, high_x = points[first:end, 0].min() - _LANE_HALF, points[first:end, 0].max() + _LANE_HALF
        low_y, high_y = points[first:end, 1].min() - _LANE_HALF, points[first:end, 1].max() + _LANE_HALF
        for light in range(len(lane)):
            x, y, row = stop[light, 0], stop[light, 1], lane[light]
            if row < 0 or not (low_x <= x <= high_x and low_y <= y <= high_y):
                continue
            lane_first, lane_end = lane_offsets[row], lane_offsets[row + 1]
            if lane_end - lane_first < 2:
                continue
            s, lateral = nearest(points, arc, heading, first, end, x, y, -np.inf, np.inf)
            beyond = min(_BEYOND, arc[end - 1] - s)
            if abs(lateral) > _LANE_HALF or s < 0.0 or beyond < 1.0:
                continue
            on_lane, _ = nearest(lane_points, lane_arc, zeros, lane_first, lane_end, x, y, -np.inf, np.inf)
            there = min(max(on_lane, 0.0) + beyond, np.float64(lane_arc[lane_end - 1]))
            k = segment_at(lane_arc, lane_first, lane_end, there)
            share = (there - lane_arc[k]) / (lane_arc[k + 1] - lane_arc[k])
            x = lane_points[k, 0] + share * (lane_points[k + 1, 0] - lane_points[k, 0])
            y = lane_points[k, 1] + share * (lane_points[k + 1, 1] - lane_points[k, 1])
            further, lateral = nearest(points, arc, heading, first, end, x, y, s, np.inf)
            if abs(lateral) <= _LANE_HALF and further > s:
                stops[n, light] = s
