"""The ground: its height, its surface at a point, and its colour over the footprint of a pixel."""

from __future__ import annotations

import math

from scenarionet_data.arrays.dtypes import Float32, Float64, Int64, UInt8
from scenarionet_data.compiled.decorators import device_function, kernel
from scenarionet_sim.arrays.minmax import larger, smaller
from scenarionet_sim.cameras.draw import codes
from scenarionet_sim.cameras.draw.structures import Ground

SpacePoint = tuple[float, float, float]

MARGIN = 0.25
"""Strokes are in all cells closer than this [m]."""


@device_function(forceinline=True, divides_by_zero=True)
def height_at(ground: Ground, slot: int, x: float, y: float) -> float:
    """Return the height of the ground [m], bilinear between the corners of its cells and constant beyond the grid."""
    frame = ground.height_frame[slot]
    columns, rows = int(frame[3]), int(frame[4])
    if columns == 0:
        return float(ground.level[slot])
    u = smaller(larger((x - frame[0]) / frame[2], 0.0), columns - 1.0)
    v = smaller(larger((y - frame[1]) / frame[2], 0.0), rows - 1.0)
    column, row = smaller(int(u), columns - 2), smaller(int(v), rows - 2)
    u, v = u - column, v - row
    first = ground.place[slot, 1] + row * columns + column
    below = ground.heights[first] * (1.0 - u) + ground.heights[first + 1] * u
    above = ground.heights[first + columns] * (1.0 - u) + ground.heights[first + columns + 1] * u
    return float(below * (1.0 - v) + above * v)


@device_function(divides_by_zero=True)
def meet_heights(ground: Ground, slot: int, eye: SpacePoint, ray: SpacePoint, reach: float) -> float:
    """Return how far along a direction a ray first meets uneven ground; infinite if it does not within ``reach``."""
    (x, y, z), (dx, dy, dz) = eye, ray
    flat = math.hypot(dx, dy)
    before, above = 0.0, z - height_at(ground, slot, x, y)
    if above <= 0.0 or flat < 1e-9:
        return 0.0 if above <= 0.0 else (above / -dz if dz < 0.0 else math.inf)
    length = math.sqrt(flat * flat + dz * dz)
    along = before
    while along * length < reach:
        along = before + larger(larger(0.5, 0.02 * before * length), 0.5 * above) / length
        gap = z + along * dz - height_at(ground, slot, x + along * dx, y + along * dy)
        if gap <= 0.0:
            for _ in range(30):  # halves the interval, or better
                middle = before + (along - before) * smaller(larger(above / (above - gap), 0.02), 0.98)
                here = z + middle * dz - height_at(ground, slot, x + middle * dx, y + middle * dy)
                if abs(here) < 1e-5:
                    return middle
                if here > 0.0:
                    before, above = middle, here
                else:
                    along, gap = middle, here
            return along
        before, above = along, gap
    return math.inf


@device_function(forceinline=True, divides_by_zero=True)
def cell_of(ground: Ground, slot: int, x: float, y: float) -> int:
    """Return the cell at a point, or -1 beyond the grid."""
    frame = ground.frame[slot]
    u, v = (x - frame[0]) / frame[2], (y - frame[1]) / frame[2]
    if not (u >= 0.0 and v >= 0.0 and u < frame[3] and v < frame[4]):
        return -1
    return int(ground.place[slot, 0]) + int(v) * int(frame[3]) + int(u)


@device_function(forceinline=True, divides_by_zero=True)
def surface_at(ground: Ground, slot: int, cell: int, x: float, y: float) -> int:
    """Return the surface bits at a point of a cell: those of its corner, changed at every border on the way there."""
    bits = int(ground.corner[cell])
    frame = ground.frame[slot]
    number = cell - ground.place[slot, 0]
    columns = int(frame[3])
    corner_x = frame[0] + frame[2] * (number % columns)
    corner_y = frame[1] + frame[2] * (number // columns)
    for k in range(ground.cell_start[cell], ground.cell_start[cell + 1]):
        kind = ground.stroke_kind[k]
        if kind > codes.CROSSWALK_BORDER:
            continue
        x0, y0 = ground.strokes[k, 0] * 1.0, ground.strokes[k, 1] * 1.0
        x1, y1 = ground.strokes[k, 2] * 1.0, ground.strokes[k, 3] * 1.0
        if (x0 <= corner_x) != (x1 <= corner_x):
            crossing = y0 + (corner_x - x0) / (x1 - x0) * (y1 - y0)
            if corner_y < crossing <= y:
                bits ^= 1 << kind
        if (y0 <= y) != (y1 <= y):
            crossing = x0 + (y - y0) / (y1 - y0) * (x1 - x0)
            if corner_x < crossing <= x:
                bits ^= 1 << kind
    return bits


@device_function(forceinline=True, divides_by_zero=True)
def paint_at(ground: Ground, cell: int, x: float, y: float) -> int:
    """Return the kind of the last painted stroke that contains a point, or -1."""
    found = -1
    for k in range(ground.cell_start[cell], ground.cell_start[cell + 1]):
        if ground.stroke_kind[k] >= codes.WHITE:
            stroke = ground.strokes[k]
            dx, dy = x - stroke[0], y - stroke[1]
            along, beside = dx * stroke[2] + dy * stroke[3], dy * stroke[2] - dx * stroke[3]
            if 0.0 <= along <= stroke[4] and abs(beside) <= stroke[5]:
                found = int(ground.stroke_kind[k])
    return found


@kernel
def fill_corners(edges: Float64, bit: int, frame: Float64, corner: UInt8) -> None:
    """Set a bit at the lower left corners of the cells inside outlines given by their edges (E, 4), by parity.

    Args:
        edges: Edges x0, y0, x1, y1 [m] of all outlines.
        bit: Bit to set.
        frame: (5,) see ``Ground.frame``.
        corner: (C,) output.
    """
    columns, rows = int(frame[3]), int(frame[4])
    for e in range(len(edges)):
        x0, y0, x1, y1 = edges[e]
        first = int(larger(math.ceil((smaller(y0, y1) - frame[1]) / frame[2]) - 1.0, 0.0))
        last = int(smaller(math.floor((larger(y0, y1) - frame[1]) / frame[2]) + 1.0, rows - 1.0))
        for row in range(first, last + 1):
            y = frame[1] + frame[2] * row
            if (y0 <= y) != (y1 <= y):
                x = x0 + (y - y0) / (y1 - y0) * (x1 - x0)
                column = int(larger(math.ceil((x - frame[0]) / frame[2]), 0.0))
                if column < columns:
                    corner[row * columns + column] ^= bit
    for row in range(rows):
        inside = 0
        for column in range(columns):
            inside ^= int(corner[row * columns + column]) & bit
            kept = int(corner[row * columns + column]) & ~bit
            corner[row * columns + column] = kept | inside


@kernel
def list_strokes(
    strokes: Float32, kinds: UInt8, frame: Float64, starts: Int64, items: Int64, is_counting: bool
) -> None:
    """Count the strokes near every cell, or list them.

    Args:
        strokes, kinds: (S, 6), (S,) see the kinds of stroke.
        frame: (5,) see ``Ground.frame``.
        starts: (C + 1,) counts to add to at ``cell + 1``, or first free places, which move on.
        items: (K,) output when listing.
        is_counting: Whether to count.
    """
    columns, rows, side = int(frame[3]), int(frame[4]), frame[2]
    for s in range(len(strokes)):
        x0, y0 = strokes[s, 0] * 1.0, strokes[s, 1] * 1.0
        if kinds[s] >= codes.WHITE:
            ux, uy, length, half = strokes[s, 2] * 1.0, strokes[s, 3] * 1.0, strokes[s, 4] * 1.0, strokes[s, 5] * 1.0
        else:
            ux, uy = strokes[s, 2] - x0, strokes[s, 3] - y0
            length, half = math.sqrt(ux * ux + uy * uy), 0.0
            ux, uy = ux / larger(length, 1e-9), uy / larger(length, 1e-9)
        reach = half + MARGIN
        x1, y1 = x0 + ux * length, y0 + uy * length
        first_column = int(larger(math.floor((smaller(x0, x1) - reach - frame[0]) / side), 0.0))
        last_column = int(smaller(math.floor((larger(x0, x1) + reach - frame[0]) / side), columns - 1.0))
        first_row = int(larger(math.floor((smaller(y0, y1) - reach - frame[1]) / side), 0.0))
        last_row = int(smaller(math.floor((larger(y0, y1) + reach - frame[1]) / side), rows - 1.0))
        extent = 0.5 * side * (abs(ux) + abs(uy)) + reach
        for row in range(first_row, last_row + 1):
            dy = frame[1] + (row + 0.5) * side - y0
            for column in range(first_column, last_column + 1):
                dx = frame[0] + (column + 0.5) * side - x0
                along, beside = dx * ux + dy * uy, dy * ux - dx * uy
                if -extent <= along <= length + extent and abs(beside) <= extent:
                    cell = row * columns + column
                    if is_counting:
                        starts[cell + 1] += 1
                    else:
                        items[starts[cell]] = s
                        starts[cell] += 1
