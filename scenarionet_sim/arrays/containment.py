"""Point in polygon."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from scenarionet_data.arrays.dtypes import Bool, Float32, Float64, Int32
from scenarionet_data.compiled.decorators import device_function, kernel

STRIP = 8
"""Consecutive edges of outlines that are left out together, if a point is above or below all of them."""


def strips_of(outlines: Float32) -> Float32:
    """Return the lowest and highest y (S, 2) of every ``STRIP`` edges between consecutive points of (P, 2) outlines.

    The last edge of an outline, which closes it, is in no strip.
    """
    first = np.arange(0, len(outlines), STRIP)
    if not len(first):
        return np.zeros((0, 2), np.float32)
    y = outlines[:, 1]
    follower = y[np.minimum(first + STRIP, len(outlines) - 1)]
    lowest = np.minimum(np.minimum.reduceat(y, first), follower)
    return np.stack([lowest, np.maximum(np.maximum.reduceat(y, first), follower)], axis=1)


def blocks_of(strips: Float32) -> Float32:
    """Return the lowest and highest y (B, 2) of every ``STRIP`` strips."""
    first = np.arange(0, len(strips), STRIP)
    if not len(first):
        return strips
    return np.stack([np.minimum.reduceat(strips[:, 0], first), np.maximum.reduceat(strips[:, 1], first)], axis=1)


@device_function
def winding_number(x: float, y: float, outline: Float32, strips: Float32, blocks: Float32, start: int, end: int) -> int:
    """Return the winding number of the closed outline ``outline[start:end]`` (P, 2) around a point; 0 outside.

    Non-zero inside, also where an outline overlaps itself, as a wide lane's does on the inside of a tight bend.
    Source: D. Sunday, "Inclusion of a point in a polygon", 2001.
    """
    if start == end:
        return 0
    turns = _turns(x, y, outline, end - 1, start)
    index = start
    while index < end - 1:
        block, strip = index // (STRIP * STRIP), index // STRIP
        if not blocks[block, 0] <= y < blocks[block, 1]:
            index = STRIP * STRIP * (block + 1)
            continue
        following = min(STRIP * (strip + 1), end - 1)
        if strips[strip, 0] <= y < strips[strip, 1]:
            for edge in range(index, following):
                turns += _turns(x, y, outline, edge, edge + 1)
        index = following
    return turns


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
def _is_around(polygons: PolygonGrid, polygon: int, x: float, y: float) -> bool:
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
        x, y = points[query, 0], points[query, 1]
        found[query] = -1
        cell = cell_at(x, y, polygons.frame)
        if cell < 0:
            continue
        for place in range(polygons.cell_start[cell], polygons.cell_start[cell + 1]):
            polygon = polygons.cell_items[place]
            if is_selected[polygon] and _is_around(polygons, polygon, x, y):
                found[query] = polygon
                break


@kernel(allocates=False)
def find_stays(
    points: Float64,
    polygons: PolygonGrid,
    num_polygons: int,
    first: Int32,
    starts: Int32,
    around: Int32,
) -> int:
    """Find the stays of points that move together: the moments at which the polygons around one of them change.

    Args:
        points: (T, K, 2) [m].
        polygons: See :func:`find_polygon`.
        num_polygons: The first polygons, which count.
        first: (T,) output: first moment of each stay.
        starts: (T * K + 1,) output: where the polygons around each point of each stay begin in ``around``.
        around: Output: the polygons; room for all in the fullest cell at every point.

    Returns:
        The number of stays.
    """
    stays, count = 0, points.shape[1]
    for t in range(len(points)):
        begin = filled = starts[stays * count]
        for k in range(count):
            x, y = points[t, k, 0], points[t, k, 1]
            cell = cell_at(x, y, polygons.frame)
            if cell >= 0:
                for place in range(polygons.cell_start[cell], polygons.cell_start[cell + 1]):
                    polygon = polygons.cell_items[place]
                    if polygon < num_polygons and _is_around(polygons, polygon, x, y):
                        around[filled] = polygon
                        filled += 1
            starts[stays * count + k + 1] = filled
        if stays == 0 or not _is_repeated(starts, around, stays, count, filled - begin):
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
def cell_at(x: float, y: float, frame: Float64) -> int:
    """Return the cell of a grid that a point is in, or -1 outside of the grid."""
    column, row = np.floor((x - frame[0]) / frame[2]), np.floor((y - frame[1]) / frame[2])
    if not (0 <= column < frame[3] and 0 <= row < frame[4]):
        return -1
    return int(row * frame[3] + column)
