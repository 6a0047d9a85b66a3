"""Point in polygon."""

from __future__ import annotations

import numpy as np

from scenarionet_data.arrays.compiled import device_function, kernel
from scenarionet_data.arrays.dtypes import Bool, Float32, Float64, Int32


@device_function
def winding_number(x: float, y: float, outline: Float32, start: int, end: int) -> int:
    """Return the winding number of the closed outline ``outline[start:end]`` (P, 2) around a point; 0 outside.

    Non-zero inside, also where an outline overlaps itself, as a wide lane's does on the inside of a tight bend.
    Source: D. Sunday, "Inclusion of a point in a polygon", 2001.
    """
    turns = 0
    for index in range(start, end):
        follower = index + 1 if index + 1 < end else start
        x0, y0, x1, y1 = outline[index, 0], outline[index, 1], outline[follower, 0], outline[follower, 1]
        if (y0 <= y) != (y1 <= y):
            side = (x1 - x0) * (y - y0) - (x - x0) * (y1 - y0)
            if y0 <= y and side > 0:
                turns += 1
            elif y0 > y and side < 0:
                turns -= 1
    return turns


@kernel
def find_polygon(
    points: Float64,
    outlines: Float32,
    offsets: Int32,
    is_selected: Bool,
    frame: Float64,
    cell_start: Int32,
    cell_items: Int32,
    found: Int32,
) -> None:
    """Find the first selected polygon around each point, with a grid over the polygons.

    Args:
        points: (Q, 2) [m].
        outlines, offsets: (P, 2) [m] and (M + 1,): polygon i is ``outlines[offsets[i]:offsets[i + 1]]``, closed.
        is_selected: (M,) polygons to search.
        frame, cell_start, cell_items: The grid, see :class:`scenarionet_sim.roads.grid.Grid`.
        found: (Q,) int32 output: row of the polygon, or -1.
    """
    for query in range(points.shape[0]):
        x, y = points[query, 0], points[query, 1]
        found[query] = -1
        cell = cell_at(x, y, frame)
        if cell < 0:
            continue
        for place in range(cell_start[cell], cell_start[cell + 1]):
            polygon = cell_items[place]
            if is_selected[polygon] and winding_number(x, y, outlines, offsets[polygon], offsets[polygon + 1]) != 0:
                found[query] = polygon
                break


@kernel
def find_polygons(
    points: Float64,
    outlines: Float32,
    offsets: Int32,
    frame: Float64,
    cell_start: Int32,
    cell_items: Int32,
    inside: Bool,
) -> None:
    """Find all of the first polygons around each point, with a grid over the polygons.

    Args:
        points, outlines, offsets, frame, cell_start, cell_items: See :func:`find_polygon`.
        inside: (Q, M) output, False before: whether a point is in each of the first M polygons.
    """
    for query in range(points.shape[0]):
        x, y = points[query, 0], points[query, 1]
        cell = cell_at(x, y, frame)
        if cell < 0:
            continue
        for place in range(cell_start[cell], cell_start[cell + 1]):
            polygon = cell_items[place]
            if polygon < inside.shape[1]:
                turns = winding_number(x, y, outlines, offsets[polygon], offsets[polygon + 1])
                inside[query, polygon] = turns != 0


@device_function
def cell_at(x: float, y: float, frame: Float64) -> int:
    """Return the cell of a grid that a point is in, or -1 outside of the grid."""
    column, row = np.floor((x - frame[0]) / frame[2]), np.floor((y - frame[1]) / frame[2])
    if not (0 <= column < frame[3] and 0 <= row < frame[4]):
        return -1
    return int(row * frame[3] + column)
