"""Rays in the plane: how far an agent sees until a box, or a line of the map, is in the way.

Rays start at the agent's centre and turn with it: ray k has the direction ``directions[k]`` in the agent's frame
(x forward, y left). What is written is the distance as a share of the range: 0 at the centre, 1 for nothing seen.
"""

from __future__ import annotations

import numpy as np

from scenarionet_data.arrays.compiled import device_function, kernel
from scenarionet_data.arrays.dtypes import Bool, Float32, Float64, Int32, UInt8
from scenarionet_sim.kernels.minmax import larger, smaller

_HUGE = 1e300
"""Stands for 1 / 0: times 0 it is 0, where infinity would give NaN."""


@device_function
def _inverse(value: float) -> float:
    return 1.0 / value if value != 0.0 else _HUGE


@device_function
def ray_through_box(x: float, y: float, dx: float, dy: float, half_x: float, half_y: float) -> tuple[float, float]:
    """Where a line enters and leaves a box around 0 [its direction's length]; it misses it if it leaves first."""
    over_x, over_y = _inverse(dx), _inverse(dy)
    x0, x1 = (-half_x - x) * over_x, (half_x - x) * over_x
    y0, y1 = (-half_y - y) * over_y, (half_y - y) * over_y
    return larger(smaller(x0, x1), smaller(y0, y1)), smaller(larger(x0, x1), larger(y0, y1))


@device_function
def rays_at_circle(x: float, y: float, radius: float, count: int) -> tuple[int, int]:
    """First and last of ``count`` evenly spread rays that may meet a circle at (x, y); -1 is the last ray of all."""
    apart = np.sqrt(x * x + y * y)
    if apart <= radius:
        return 0, count - 1
    middle, half = np.arctan2(y, x), np.arcsin(radius / apart)
    per_radian = count / (2.0 * np.pi)
    first = int(np.ceil((middle - half) * per_radian - 1e-9))
    last = int(np.floor((middle + half) * per_radian + 1e-9))
    return first, smaller(last, first + count - 1)


@device_function
def box_ahead(
    dx: float, dy: float, cos: float, sin: float, turn: float, half_x: float, half_y: float, reach: float, count: int
) -> tuple[int, int, float, float, float, float]:
    """A box as an agent sees it.

    Args:
        dx, dy: From the agent to the box.
        cos, sin: Of the agent's heading.
        turn: From the agent's heading to the box's.
        half_x, half_y: Half of the box's length and width.
        reach, count: Range, and number of rays, evenly spread from straight ahead.

    Returns:
        First and last ray that may meet it, the first beyond the last when it is out of reach; the agent's place
        x, y in the box's frame; cosine and sine of ``turn``.
    """
    radius = np.sqrt(half_x * half_x + half_y * half_y)
    if dx * dx + dy * dy >= (reach + radius) * (reach + radius):
        return 0, -1, 0.0, 0.0, 0.0, 0.0
    ahead, left = cos * dx + sin * dy, cos * dy - sin * dx
    first, last = rays_at_circle(ahead, left, radius, count)
    cos, sin = np.cos(turn), np.sin(turn)
    return first, last, -(cos * ahead + sin * left), -(cos * left - sin * ahead), cos, sin


@kernel
def cast_at_boxes(
    agents: Int32,
    position: Float64,
    heading: Float64,
    size: Float64,
    object_type: UInt8,
    present: Bool,
    is_seen: Bool,
    directions: Float64,
    reach: float,
    out: Float32,
) -> None:
    """What evenly spread rays of each agent see of the other objects' boxes.

    Only the rays that may meet a box's circumscribed circle are tried against it.

    Args:
        agents: (A, 2) world and row.
        position, heading, size, object_type, present: The state of W worlds, see ``State``.
        is_seen: (256,) by ``ObjectType``.
        directions: (R, 2) unit vectors at angles 2 pi k / R from straight ahead, counter-clockwise.
        reach: Range [m].
        out: (A, R), written.
    """
    count = directions.shape[0]
    for a in range(agents.shape[0]):
        w, me = agents[a, 0], agents[a, 1]
        cos_me, sin_me = np.cos(heading[w, me]), np.sin(heading[w, me])
        for ray in range(count):
            out[a, ray] = 1.0
        for n in range(position.shape[1]):
            if n == me or not present[w, n] or not is_seen[object_type[w, n]]:
                continue
            dx, dy = position[w, n, 0] - position[w, me, 0], position[w, n, 1] - position[w, me, 1]
            half_x, half_y, turn = 0.5 * size[w, n, 0], 0.5 * size[w, n, 1], heading[w, n] - heading[w, me]
            first, last, x, y, cos, sin = box_ahead(dx, dy, cos_me, sin_me, turn, half_x, half_y, reach, count)
            for ray in range(first, last + 1):
                k = ray - count if ray >= count else ray + count if ray < 0 else ray
                forward = cos * directions[k, 0] + sin * directions[k, 1]
                left = cos * directions[k, 1] - sin * directions[k, 0]
                enter, leave = ray_through_box(x, y, forward, left, half_x, half_y)
                share = larger(enter, 0.0) / reach
                if enter <= leave and leave >= 0.0 and share < out[a, k]:
                    out[a, k] = share


@device_function
def nearest_segment(
    x: float,
    y: float,
    dx: float,
    dy: float,
    reach: float,
    segments: Float32,
    segment_type: UInt8,
    is_seen: Bool,
    origin: Float32,
    shape: Int32,
    cell_size: float,
    cell_start: Int32,
    cell_items: Int32,
) -> float:
    """Distance [m] from (x, y) along the unit vector (dx, dy) to the nearest segment seen, ``reach`` if none is.

    Walks through the cells of the grid that the ray crosses, nearest first, and stops at the first with a hit.
    Source: J. Amanatides, A. Woo, "A fast voxel traversal algorithm for ray tracing", 1987.
    """
    over_x, over_y = _inverse(dx), _inverse(dy)
    left, low = np.float64(origin[0]), np.float64(origin[1])
    width, height = shape[0] * cell_size, shape[1] * cell_size
    enter, leave = ray_through_box(x - left - width / 2, y - low - height / 2, dx, dy, width / 2, height / 2)
    start, best = larger(enter, 0.0), reach
    if enter > leave or leave < 0.0 or start >= reach:
        return best
    column = smaller(larger(int((x + start * dx - left) / cell_size), 0), shape[0] - 1)
    row = smaller(larger(int((y + start * dy - low) / cell_size), 0), shape[1] - 1)
    step_x, step_y = (1 if dx > 0 else -1), (1 if dy > 0 else -1)
    next_x = (left + (column + (dx > 0)) * cell_size - x) * over_x
    next_y = (low + (row + (dy > 0)) * cell_size - y) * over_y
    along_x, along_y = cell_size * abs(over_x), cell_size * abs(over_y)
    while 0 <= column < shape[0] and 0 <= row < shape[1]:
        cell = row * shape[0] + column
        for place in range(cell_start[cell], cell_start[cell + 1]):
            s = cell_items[place]
            if is_seen[segment_type[s]]:
                best = smaller(best, _ray_to_segment(x, y, dx, dy, segments, s, best))
        if best <= smaller(next_x, next_y):
            break
        if next_x < next_y:
            next_x += along_x
            column += step_x
        else:
            next_y += along_y
            row += step_y
    return best


@device_function
def _ray_to_segment(x: float, y: float, dx: float, dy: float, segments: Float32, s: int, otherwise: float) -> float:
    ax, ay = segments[s, 0] - x, segments[s, 1] - y
    bx, by = segments[s, 2] - x, segments[s, 3] - y
    side_a, side_b = dx * ay - dy * ax, dx * by - dy * bx
    if (side_a > 0.0 and side_b > 0.0) or (side_a < 0.0 and side_b < 0.0) or side_a == side_b:
        return otherwise  # on one side of the ray, or along it
    share = side_a / (side_a - side_b)
    along = (ax + share * (bx - ax)) * dx + (ay + share * (by - ay)) * dy
    return along if along >= 0.0 else otherwise


@kernel
def cast_at_segments(
    agents: Int32,
    position: Float64,
    heading: Float64,
    segments: Float32,
    segment_type: UInt8,
    is_seen: Bool,
    origin: Float32,
    shape: Int32,
    cell_size: Float64,
    cell_start: Int32,
    cell_items: Int32,
    directions: Float64,
    reach: float,
    out: Float32,
) -> None:
    """What rays of each agent see of the lines of its map.

    Args:
        agents: (A, 2) world and row.
        position, heading: The state of W worlds, see ``State``.
        segments, segment_type: (W, S, 4) [m], (W, S), see ``Roads``.
        is_seen: (256,) by ``MapFeatureType``.
        origin, shape, cell_size, cell_start, cell_items: The grid over the segments, each with a first axis W.
        directions: (R, 2) unit vectors in the agent's frame.
        reach: Range [m].
        out: (A, R), written.
    """
    for a in range(agents.shape[0]):
        w, me = agents[a, 0], agents[a, 1]
        x, y = position[w, me, 0], position[w, me, 1]
        cos, sin = np.cos(heading[w, me]), np.sin(heading[w, me])
        for ray in range(directions.shape[0]):
            forward, left = directions[ray, 0], directions[ray, 1]
            dx, dy = cos * forward - sin * left, sin * forward + cos * left
            seen = nearest_segment(
                x,
                y,
                dx,
                dy,
                reach,
                segments[w],
                segment_type[w],
                is_seen,
                origin[w],
                shape[w],
                cell_size[w],
                cell_start[w],
                cell_items[w],
            )
            out[a, ray] = seen / reach
