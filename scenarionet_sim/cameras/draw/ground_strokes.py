"""Strokes on the ground: borders of surfaces and paint, over the footprints of pixels."""

from __future__ import annotations

import math
from typing import NamedTuple

from scenarionet_data.arrays.dtypes import Float32, Float64, Int32
from scenarionet_data.compiled.decorators import device_function
from scenarionet_sim.arrays.minmax import larger, smaller
from scenarionet_sim.cameras.draw import codes
from scenarionet_sim.cameras.draw import columns as at
from scenarionet_sim.cameras.draw.single_precision import single
from scenarionet_sim.cameras.draw.structures import Ground

Six = tuple[float, float, float, float, float, float]


class Footprints(NamedTuple):
    """Where pixels see the ground: the rows of ``FrameMemory.shades`` of these names.

    They are passed whole to draw on a run of pixels, as to cut them takes longer.
    """

    x: Float32
    y: Float32
    view_x: Float32
    view_y: Float32
    across: Float32
    along: Float32


@device_function(divides_by_zero=True, in_lanes=True)
def draw_strokes(count: int, ground: Ground, slot: int, cells: Int32, shades: Float32) -> None:
    """Write the shares of road, pavement and paint in the pixels of cells with strokes, a run in one cell at a time.

    Args:
        count: Pixels of the tile.
        ground, slot: Ground and world.
        cells: Cell of each pixel, -1 where it has no strokes.
        shades: Memory of the tile.
    """
    for row in range(at.WHITE_SHARE, at.KERB_SHARE + 1):
        shares = shades[row]
        for k in range(count):
            shares[k] = 0.0
    _aim(count, shades[at.RAY_X], shades[at.RAY_Y], shades[at.VIEW_X], shades[at.VIEW_Y])
    first = 0
    while first < count:
        cell = cells[first]
        if cell < 0:
            first += 1
            continue
        end = first + 1
        while end < count and cells[end] == cell:
            end += 1
        _draw_cell(ground, slot, int(cell), first, end, shades)
        first = end


@device_function(divides_by_zero=True, in_lanes=True)
def _aim(count: int, ray_x: Float32, ray_y: Float32, view_x: Float32, view_y: Float32) -> None:
    """Write the horizontal directions of view."""
    for k in range(count):
        per = 1.0 / math.sqrt(ray_x[k] * ray_x[k] + ray_y[k] * ray_y[k] + 1e-12)
        view_x[k], view_y[k] = ray_x[k] * per, ray_y[k] * per


@device_function(divides_by_zero=True, in_lanes=True)
def _draw_cell(ground: Ground, slot: int, cell: int, first: int, end: int, shades: Float32) -> None:
    """Draw the strokes of a cell on a run of pixels."""
    frame, widest = ground.frame[slot], _widest(first, end, shades[at.ACROSS], shades[at.ALONG])
    spots = Footprints(
        shades[at.GROUND_X], shades[at.GROUND_Y], shades[at.VIEW_X], shades[at.VIEW_Y], shades[at.ACROSS],
        shades[at.ALONG],
    )  # fmt: skip
    has_borders = False
    for n in range(ground.cell_start[cell], ground.cell_start[cell + 1]):
        kind, stroke = ground.stroke_kind[n], ground.strokes[n]
        if kind >= codes.WHITE:
            target = at.WHITE_SHARE + (1 if kind == codes.YELLOW else (2 if kind == codes.KERB else 0))
            _paint(stroke, frame, widest, first, end, spots, shades[target])
        elif kind != codes.CROSSWALK_BORDER:
            if not has_borders:
                has_borders = True
                for row in range(at.ROAD_EDGE, at.ROAD_EDGE + 2):
                    edges = shades[row]
                    for k in range(first, end):
                        edges[k] = 1e9
            side = 0 if kind == codes.ROAD_BORDER else 1
            number = cell - int(ground.place[slot, 0])
            _cross(stroke, frame, number, first, end, spots, shades[at.ON_ROAD + side], shades[at.ROAD_EDGE + side])
    if has_borders:
        for side in range(2):
            _soften(first, end, shades[at.ROAD_EDGE + side], shades[at.ON_ROAD + side])


@device_function(divides_by_zero=True, in_lanes=True)
def _widest(first: int, end: int, across: Float32, along: Float32) -> float:
    """Return the largest extent of the footprints of a run of pixels [m]."""
    widest = single(0.0)
    for k in range(first, end):
        widest = larger(widest, across[k] + along[k])
    return widest


@device_function(divides_by_zero=True, in_lanes=True)
def _soften(first: int, end: int, edges: Float32, shares: Float32) -> None:
    """Blend both sides of a border in the pixels that it passes through."""
    for k in range(first, end):
        shares[k] += larger(0.5 - edges[k], 0.0) * (1.0 - 2.0 * shares[k])


@device_function(divides_by_zero=True, in_lanes=True)
def _paint(
    stroke: Float32, frame: Float64, widest: float, first: int, end: int, spots: Footprints, shares: Float32
) -> None:
    """Cover a run of pixels, whose footprints are at most ``widest`` [m], with a painted rectangle."""
    x0, y0, ux, uy = single(stroke[0] - frame[0]), single(stroke[1] - frame[1]), stroke[2], stroke[3]
    half, half_length, last = stroke[5], single(0.5) * stroke[4], end - 1
    xs, ys = spots.x, spots.y
    limit = half + 0.5 * widest
    left, right = (ys[first] - y0) * ux - (xs[first] - x0) * uy, (ys[last] - y0) * ux - (xs[last] - x0) * uy
    if smaller(left, right) > limit or larger(left, right) < -limit:
        return
    limit = half_length + 0.5 * widest
    rear = (xs[first] - x0) * ux + (ys[first] - y0) * uy - half_length
    front = (xs[last] - x0) * ux + (ys[last] - y0) * uy - half_length
    if smaller(rear, front) > limit or larger(rear, front) < -limit:
        return
    _cover(first, end, (x0, y0, ux, uy, half, half_length), spots, shares)


@device_function(divides_by_zero=True, in_lanes=True)
def _cover(first: int, end: int, stroke: Six, spots: Footprints, shares: Float32) -> None:
    """Raise the shares of a rectangle in pixels to the part of their footprints that it covers."""
    x0, y0, ux, uy, half, half_length = stroke
    xs, ys, view_x, view_y, across, along = spots
    for k in range(first, end):
        straight, beside = abs(ux * view_x[k] + uy * view_y[k]), abs(ux * view_y[k] - uy * view_x[k])
        wide = straight * across[k] + beside * along[k] + 1e-6
        deep = straight * along[k] + beside * across[k] + 1e-6
        dx, dy = xs[k] - x0, ys[k] - y0
        off, on = dy * ux - dx * uy, dx * ux + dy * uy - half_length
        part = smaller(off + 0.5 * wide, half) - larger(off - 0.5 * wide, -half)
        rest = smaller(on + 0.5 * deep, half_length) - larger(on - 0.5 * deep, -half_length)
        shares[k] = larger(shares[k], larger(part, 0.0) * larger(rest, 0.0) / (wide * deep))


@device_function(divides_by_zero=True, in_lanes=True)
def _cross(
    stroke: Float32, frame: Float64, number: int, first: int, end: int, spots: Footprints, shares: Float32,
    edges: Float32,
) -> None:  # fmt: skip
    """Change the surface at the pixels of a run beyond a border, and write their distance to it in footprints.

    Beyond means that the way from the corner of the cell, first along y and then along x, crosses the border.
    """
    columns = int(frame[3])
    corner_x, corner_y = frame[2] * (number % columns), frame[2] * (number // columns)
    x0, y0, x1, y1 = stroke[0] - frame[0], stroke[1] - frame[1], stroke[2] - frame[0], stroke[3] - frame[1]
    ex, ey = x1 - x0, y1 - y0
    above = math.inf  # a crossing of the cell's left side changes all points above it
    if (x0 <= corner_x) != (x1 <= corner_x):
        crossing = y0 + (corner_x - x0) / ex * ey
        above = crossing if corner_y < crossing else math.inf
    per_y = ex / ey if ey != 0.0 else 0.0
    low, high = single(smaller(y0, y1)), single(larger(y0, y1))
    border = low, high, single(x0), single(y0), single(per_y), single(corner_x)
    _turn_over(first, end, border, single(above), spots.x, spots.y, shares)
    length = math.sqrt(ex * ex + ey * ey + 1e-12)
    edge = single(x0), single(y0), single(ex / length), single(ey / length), single(length)
    _measure_edge(first, end, edge, spots, edges)


@device_function(divides_by_zero=True, in_lanes=True)
def _turn_over(first: int, end: int, border: Six, above: float, xs: Float32, ys: Float32, shares: Float32) -> None:
    """Turn over the shares of a surface beyond a border."""
    low, high, x0, y0, per_y, left = border
    for k in range(first, end):
        crossing = x0 + (ys[k] - y0) * per_y
        is_right = (low <= ys[k]) & (ys[k] < high) & (left < crossing) & (crossing <= xs[k])
        before = shares[k]
        shares[k] = 1.0 - before if is_right != (above <= ys[k]) else before


@device_function(divides_by_zero=True, in_lanes=True)
def _measure_edge(
    first: int, end: int, edge: tuple[float, float, float, float, float], spots: Footprints, edges: Float32
) -> None:
    """Write the distances to a border in footprints where it is nearer than others."""
    x0, y0, ux, uy, length = edge
    xs, ys, view_x, view_y, across, along = spots
    for k in range(first, end):
        dx, dy = xs[k] - x0, ys[k] - y0
        here = dx * ux + dy * uy
        straight, beside = abs(ux * view_x[k] + uy * view_y[k]), abs(ux * view_y[k] - uy * view_x[k])
        far = abs(dy * ux - dx * uy) / (straight * across[k] + beside * along[k] + 1e-6)
        edges[k] = smaller(edges[k], far if (here >= -0.3) & (here <= length + 0.3) else 1e9)
