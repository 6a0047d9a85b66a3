"""Point in polygon."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from scenarionet_data.arrays.dtypes import Bool, Float32, Float64, Int32
from scenarionet_data.compiled.decorators import device_function, kernel

STRIP = 8
"""Consecutive edges of outlines that are left out together, if a point is above or below all of them."""


_ROUNDING = 1e-3
"""Distance beside a strip from which no rounding matters [m]."""


def strips_of(outlines: Float32) -> Float32:
    """Return the boxes (S, 4), lowest x and y and highest x and y, of every ``STRIP`` edges of (P, 2) outlines.

    Edges are those between consecutive points. The last edge of an outline, which closes it, is in no strip.
    """
    first = np.arange(0, len(outlines), STRIP)
    if not len(first):
        return np.zeros((0, 4), np.float32)
    follower = outlines[np.minimum(first + STRIP, len(outlines) - 1)]
    lowest, highest = (reduce.reduceat(outlines, first, axis=0) for reduce in (np.minimum, np.maximum))
    return np.concatenate([np.minimum(lowest, follower), np.maximum(highest, follower)], axis=1)


def blocks_of(strips: Float32) -> Float32:
    """Return the boxes (B, 4) of every ``STRIP`` strips."""
    first = np.arange(0, len(strips), STRIP)
    if not len(first):
        return strips
    lowest, highest = np.minimum.reduceat(strips[:, :2], first), np.maximum.reduceat(strips[:, 2:], first)
    return np.concatenate([lowest, highest], axis=1)


@device_function
def winding_number(x: float, y: float, outline: Float32, strips: Float32, blocks: Float32, start: int, end: int) -> int:
    """Return the winding number of the closed outline ``outline[start:end]`` (P, 2) around a point; 0 outside.

    Non-zero inside, also where an outline overlaps itself, as a wide lane's does on the inside of a tight bend. Of
    edges that are all on the right of the point only the first and the last point count, and of others none.
    Source: D. Sunday, "Inclusion of a point in a polygon", 2001.
    """
    if start == end:
        return 0
    turns = _turns(x, y, outline, end - 1, start)
    index = start
    while index < end - 1:
        block, strip = index // (STRIP * STRIP), index // STRIP
        following = min(STRIP * STRIP * (block + 1), end - 1)
        side = _side_of(x, y, blocks[block])
        if side == _AMONG:
            following = min(STRIP * (strip + 1), end - 1)
            side = _side_of(x, y, strips[strip])
        if side == _AMONG:
            for edge in range(index, following):
                turns += _turns(x, y, outline, edge, edge + 1)
        elif side == _LEFT:
            turns += int(outline[following, 1] > y) - int(outline[index, 1] > y)
        index = following
    return turns


_ELSEWHERE, _LEFT, _AMONG = range(3)


@device_function(forceinline=True)
def _side_of(x: float, y: float, box: Float32) -> int:
    """Return where a point is, seen from a box of edges: at none of their heights or on the right; left; or else."""
    if not box[1] <= y < box[3] or x > box[2] + _ROUNDING:
        return _ELSEWHERE
    return _LEFT if x < box[0] - _ROUNDING else _AMONG


@device_function(forceinline=True)
def _turns(x: float, y: float, outline: Float32, first: int, second: int) -> int:
    """Return 1 for an edge that passes a point's height on its right upwards, -1 downwards, else 0."""
    x0, y0, x1, y1 = outline[first, 0], outline[first, 1], outline[second, 0], outline[second, 1]
    if (y0 <= y) != (y1 <= y):
        side = (x1 - x0) * (y - y0) - (x - x0) * (y1 - y0)
        if y0 <= y and side > 0:
            return 1
        if y0 > y and side < 0:
            return -1
    return 0


class PolygonGrid(NamedTuple):
    """M polygons, and a grid over them.

    Attributes:
        outlines: (P, 2) [m]: polygon i is ``outlines[offsets[i]:offsets[i + 1]]``, closed.
        strips, blocks: See :func:`strips_of` and :func:`blocks_of`.
        offsets: (M + 1,).
        bounds: (M, 4) lowest x, y and highest x, y of each polygon [m]; NaN for an empty one.
        frame, cell_start, cell_items: The grid, see :class:`scenarionet_sim.roads.grid.Grid`.
    """

    outlines: Float32
    strips: Float32
    blocks: Float32
    offsets: Int32
    bounds: Float32
    frame: Float64
    cell_start: Int32
    cell_items: Int32


@device_function
def is_around(polygons: PolygonGrid, polygon: int, x: float, y: float) -> bool:
    """Return whether a point is in a polygon."""
    bounds = polygons.bounds
    if not (bounds[polygon, 0] <= x <= bounds[polygon, 2] and bounds[polygon, 1] <= y <= bounds[polygon, 3]):
        return False
    start, end = polygons.offsets[polygon], polygons.offsets[polygon + 1]
    return winding_number(x, y, polygons.outlines, polygons.strips, polygons.blocks, start, end) != 0


@kernel
def find_polygon(
    points: Float64,
    polygons: PolygonGrid,
    is_selected: Bool,
    found: Int32,
) -> None:
    """Find the first selected polygon around each point, with a grid over the polygons.

    Args:
        points: (Q, 2) [m].
        polygons: M polygons.
        is_selected: (M,) polygons to search.
        found: (Q,) int32 output: row of the polygon, or -1.
    """
    for query in range(points.shape[0]):
        found[query] = polygon_at(points[query, 0], points[query, 1], polygons, is_selected)


@device_function
def polygon_at(x: float, y: float, polygons: PolygonGrid, is_selected: Bool) -> int:
    """Return the first selected polygon around a point, or -1."""
    cell = cell_at(x, y, polygons.frame)
    if cell >= 0:
        for place in range(polygons.cell_start[cell], polygons.cell_start[cell + 1]):
            polygon = polygons.cell_items[place]
            if is_selected[polygon] and is_around(polygons, polygon, x, y):
                return int(polygon)
    return -1


@kernel(allocates=False)
def find_stays(
    points: Float64, polygons: PolygonGrid, num_polygons: int, first: Int32, starts: Int32, around: Int32
) -> int:
    """Find the stays of points (T, K, 2) [m]; see :func:`stays_between`."""
    return stays_between(0, len(points), points, polygons, num_polygons, first, starts, around)


@device_function
def stays_between(
    begin: int,
    end: int,
    points: Float64,
    polygons: PolygonGrid,
    num_polygons: int,
    first: Int32,
    starts: Int32,
    around: Int32,
) -> int:
    """Find the stays of points that move together: the moments at which the polygons around one of them change.

    Args:
        begin, end: Rows of the T moments.
        points: (S, K, 2) [m].
        polygons: See :func:`find_polygon`.
        num_polygons: The first polygons, which count.
        first: (T,) output: first moment of each stay, from 0 on.
        starts: (T * K + 1,) output: where the polygons around each point of each stay begin in ``around``.
        around: Output: the polygons; room for all in the fullest cell at every point.

    Returns:
        The number of stays.
    """
    stays, count = 0, points.shape[1]
    for t in range(end - begin):
        empty = filled = starts[stays * count]
        for k in range(count):
            x, y = points[begin + t, k, 0], points[begin + t, k, 1]
            cell = cell_at(x, y, polygons.frame)
            if cell >= 0:
                for place in range(polygons.cell_start[cell], polygons.cell_start[cell + 1]):
                    polygon = polygons.cell_items[place]
                    if polygon < num_polygons and is_around(polygons, polygon, x, y):
                        around[filled] = polygon
                        filled += 1
            starts[stays * count + k + 1] = filled
        if stays == 0 or not _is_repeated(starts, around, stays, count, filled - empty):
            first[stays] = t
            stays += 1
    return stays


@device_function
def _is_repeated(starts: Int32, around: Int32, stay: int, count: int, length: int) -> bool:
    """Return whether the polygons around ``count`` points are those of the stay before."""
    here, last = starts[stay * count], starts[(stay - 1) * count]
    is_same = True
    for k in range(1, count + 1):
        is_same &= starts[stay * count + k] - here == starts[(stay - 1) * count + k] - last
    for n in range(length):
        is_same = is_same and around[here + n] == around[last + n]
    return is_same


@device_function
def is_near_outline(x: float, y: float, outlines: Float32, first: int, end: int, square: float) -> bool:
    """Return whether a point's squared distance [m²] from the closed outline ``outlines[first:end]`` is at most one."""
    last = end - 1
    for n in range(first, end):
        away_x, away_y = x - outlines[last, 0], y - outlines[last, 1]
        dx, dy = outlines[n, 0] - np.float64(outlines[last, 0]), outlines[n, 1] - np.float64(outlines[last, 1])
        share = min(max((away_x * dx + away_y * dy) / max(dx * dx + dy * dy, 1e-12), 0.0), 1.0)
        away_x, away_y, last = away_x - share * dx, away_y - share * dy, n
        if away_x * away_x + away_y * away_y <= square:
            return True
    return False


@device_function
def cell_at(x: float, y: float, frame: Float64) -> int:
    """Return the cell of a grid that a point is in, or -1 outside of the grid."""
    column, row = np.floor((x - frame[0]) / frame[2]), np.floor((y - frame[1]) / frame[2])
    if not (0 <= column < frame[3] and 0 <= row < frame[4]):
        return -1
    return int(row * frame[3] + column)
