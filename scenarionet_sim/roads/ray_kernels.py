"""Ray casting in the plane, at lines of the map.

Rays start at the agent's centre and turn with it. The output is the distance divided by the range: 0 at the centre,
1 without a hit.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from scenarionet_data.arrays.dtypes import Bool, Float32, Float64, UInt8
from scenarionet_data.compiled.decorators import device_function
from scenarionet_data.scenario.vocabulary import MapFeatureType, is_road_edge
from scenarionet_sim.arrays.log import HEADING, X, Y
from scenarionet_sim.arrays.minmax import larger, smaller
from scenarionet_sim.arrays.structures import BLOCKS, CELLS, CELLS_IN_BLOCK, Lines

_KINDS = (
    (MapFeatureType.ROAD_LINE_SOLID_SINGLE_WHITE, MapFeatureType.ROAD_LINE_SOLID_DOUBLE_WHITE),
    (MapFeatureType.ROAD_LINE_SOLID_SINGLE_YELLOW, MapFeatureType.ROAD_LINE_SOLID_DOUBLE_YELLOW),
    [kind for kind in MapFeatureType if is_road_edge(np.array(kind))],
    (MapFeatureType.STOP_LINE,),
)
"""Lines that sensors look for together, and all others."""


LINE_BITS: UInt8 = np.full(256, 1 << len(_KINDS), np.uint8)
"""(256,) one bit for each ``MapFeatureType``, see ``Lines.cell_types``."""
for _number, _kinds in enumerate(_KINDS):
    LINE_BITS[list(_kinds)] = 1 << _number


class RayFan(NamedTuple):
    """The rays of a sensor.

    Attributes:
        directions: (R, 2) unit vectors in the agent's frame, x forward and y left.
        reach: Range [m].
        types: (256,) visible types.
    """

    directions: Float64
    reach: float
    types: Bool


_HUGE = 1e300
"""Substitute for 1 / 0: its product with 0 is 0, where infinity would give NaN."""


@device_function
def _inverse(value: float) -> float:
    return 1.0 / value if value != 0.0 else _HUGE


@device_function
def ray_through_box(x: float, y: float, dx: float, dy: float, half_x: float, half_y: float) -> tuple[float, float]:
    """Return where a line enters and leaves a box around 0, in units of (dx, dy); a miss leaves before it enters."""
    over_x, over_y = _inverse(dx), _inverse(dy)
    x0, x1 = (-half_x - x) * over_x, (half_x - x) * over_x
    y0, y1 = (-half_y - y) * over_y, (half_y - y) * over_y
    return larger(smaller(x0, x1), smaller(y0, y1)), smaller(larger(x0, x1), larger(y0, y1))


@device_function
def nearest_segment(
    start: tuple[float, float], along: tuple[float, float], w: int, lines: Lines, rays: RayFan, types: int
) -> float:
    """Return the distance [m] from a point along a unit vector to the nearest visible segment.

    Traverses the grid cells along the ray, nearest first, and stops at the first with a hit; the reach without a hit.
    ``types`` are the bits of the visible types, as ``Lines.cell_types`` has them.
    Source: J. Amanatides, A. Woo, "A fast voxel traversal algorithm for ray tracing", 1987.
    """
    (x, y), (dx, dy), reach = start, along, rays.reach
    over_x, over_y = _inverse(dx), _inverse(dy)
    left, low, cell_size = lines.frame[w, 0], lines.frame[w, 1], lines.frame[w, 2]
    columns, rows = int(lines.frame[w, 3]), int(lines.frame[w, 4])
    first_cell, first_block = lines.place[w, CELLS], lines.place[w, BLOCKS]
    width, height = columns * cell_size, rows * cell_size
    begin, best = 0.0, reach
    if not (left <= x <= left + width and low <= y <= low + height):
        enter, leave = ray_through_box(x - left - width / 2, y - low - height / 2, dx, dy, width / 2, height / 2)
        begin = larger(enter, 0.0)
        if enter > leave or leave < 0.0 or begin >= reach:
            return best
    column = smaller(larger(int((x + begin * dx - left) / cell_size), 0), columns - 1)
    row = smaller(larger(int((y + begin * dy - low) / cell_size), 0), rows - 1)
    # A ray along an axis never reaches the next row or column: its border is ahead, at an infinite distance.
    step_x, step_y = (1 if dx >= 0.0 else -1), (1 if dy >= 0.0 else -1)
    next_x = (left + (column + (dx >= 0.0)) * cell_size - x) * over_x
    next_y = (low + (row + (dy >= 0.0)) * cell_size - y) * over_y
    along_x, along_y = cell_size * abs(over_x), cell_size * abs(over_y)
    while 0 <= column < columns and 0 <= row < rows:
        cell = row * columns + column
        if lines.cell_types[first_cell + cell] & types:
            filled = lines.block_start[first_block + cell // CELLS_IN_BLOCK] + lines.cell_rank[first_cell + cell]
            for s in range(lines.filled_start[filled], lines.filled_start[filled + 1]):
                distance = _ray_to_segment(x, y, dx, dy, lines.segments[s])
                if 0.0 <= distance < best and rays.types[lines.segment_type[s]]:
                    best = distance
        if best <= smaller(next_x, next_y):
            break
        # Without branches, as the processor does not foresee the direction of the next cell.
        is_beside = next_x < next_y
        column, row = column + (step_x if is_beside else 0), row + (0 if is_beside else step_y)
        next_x, next_y = next_x + (along_x if is_beside else 0.0), next_y + (0.0 if is_beside else along_y)
    return best


@device_function(forceinline=True)
def _ray_to_segment(x: float, y: float, dx: float, dy: float, segment: Float32) -> float:
    """Return the distance along the line of the ray, or -1 where they do not meet."""
    ax, ay = segment[0] - x, segment[1] - y
    bx, by = segment[2] - x, segment[3] - y
    side_a, side_b = dx * ay - dy * ax, dx * by - dy * bx
    if side_a * side_b > 0.0 or side_a == side_b:  # on one side of the ray, in a test that mostly fails; or parallel
        return -1.0
    share = side_a / (side_a - side_b)
    return float((ax + share * (bx - ax)) * dx + (ay + share * (by - ay)) * dy)


@device_function
def ranges_to_lines(w: int, me: Float64, lines: Lines, rays: RayFan, out: Float32) -> None:
    """Cast the rays of one agent, with the row (7,) of motion, at the lines of world ``w``; ``out`` is (R,)."""
    types = 0
    for kind in range(len(rays.types)):
        if rays.types[kind]:
            types |= LINE_BITS[kind]
    cos, sin = np.cos(me[HEADING]), np.sin(me[HEADING])
    for ray in range(len(rays.directions)):
        forward, left = rays.directions[ray, 0], rays.directions[ray, 1]
        along = cos * forward - sin * left, sin * forward + cos * left
        out[ray] = nearest_segment((me[X], me[Y]), along, w, lines, rays, types) / rays.reach
