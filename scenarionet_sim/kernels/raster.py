"""Rasterisation of polygons and lines into images of bytes.

Images are (C, H, W), row 0 at the top; pixel (r, c) is the square from (c, r) to (c + 1, r + 1). Shapes have a type
code, and ``style`` (256, 2) gives the channel (-1 for none) and the pixel value of each type. A view (6,) maps metres
to pixels: column = v0 x + v1 y + v2, row = v3 x + v4 y + v5.
"""

from __future__ import annotations

import numpy as np

from scenarionet_data.arrays.compiled import device_function, kernel
from scenarionet_data.arrays.dtypes import Bool, Float32, Float64, Int16, Int32, UInt8
from scenarionet_sim.kernels.minmax import larger, smaller
from scenarionet_sim.kernels.structures import CELLS_IN_BLOCK


@device_function
def fill(outline: Float64, count: int, value: int, picture: UInt8, turns: Int16) -> None:
    """Fill a closed outline: the pixels whose centre has a non-zero winding number.

    Args:
        outline: (count or more, 2) columns and rows.
        count: Number of points.
        value: Pixel value.
        picture: (H, W).
        turns: (H, W + 3) scratch memory, 0 before and after. Where the outline crosses the middle of a row, the
            entry at the first pixel behind the crossing changes by 1. The last two columns hold the row's first
            (as ``W - column``) and last such pixel.
    """
    height, width = picture.shape
    top, bottom = height, -1
    for i in range(count):
        j = i + 1 if i + 1 < count else 0
        x0, y0, y1 = outline[i, 0], outline[i, 1], outline[j, 1]
        first = int(smaller(larger(np.ceil(smaller(y0, y1) - 0.5), 0.0), height))
        end = int(smaller(larger(np.ceil(larger(y0, y1) - 0.5), 0.0), height))
        if first >= end:
            continue
        top, bottom = smaller(top, first), larger(bottom, end - 1)
        slope = (outline[j, 0] - x0) / (y1 - y0)
        for row in range(first, end):
            column = int(smaller(larger(np.ceil(x0 + (row + 0.5 - y0) * slope - 0.5), 0.0), width))
            turns[row, column] += 1 if y1 > y0 else -1
            turns[row, width + 1] = larger(turns[row, width + 1], width - column)
            turns[row, width + 2] = larger(turns[row, width + 2], column)
    for row in range(top, bottom + 1):
        inside = 0
        for column in range(width - turns[row, width + 1], turns[row, width + 2] + 1):
            inside += turns[row, column]
            turns[row, column] = 0
            if inside != 0:
                picture[row, column] = value
        turns[row, width + 1], turns[row, width + 2] = 0, 0


@device_function
def draw_line(x0: float, y0: float, x1: float, y1: float, value: int, picture: UInt8) -> None:
    """Draw a line one pixel wide: both ends, and one pixel per column (or row, if it is steep) between."""
    height, width = picture.shape
    for x, y in ((x0, y0), (x1, y1)):
        if 0.0 <= x < width and 0.0 <= y < height:
            picture[int(y), int(x)] = value
    is_steep = abs(y1 - y0) > abs(x1 - x0)
    if is_steep:
        x0, y0, x1, y1, width, height = y0, x0, y1, x1, height, width
    if x0 > x1:
        x0, y0, x1, y1 = x1, y1, x0, y0
    first, end = larger(np.ceil(x0 - 0.5), 0.0), smaller(np.ceil(x1 - 0.5), width)
    if first >= end:
        return
    slope = (y1 - y0) / (x1 - x0)
    for at in range(int(first), int(end)):
        beside = y0 + (at + 0.5 - x0) * slope
        if 0.0 <= beside < height:
            if is_steep:
                picture[at, int(beside)] = value
            else:
                picture[int(beside), at] = value


@device_function
def to_pixel(view: Float64, x: float, y: float) -> tuple[float, float]:
    """Return column and row of a point."""
    return view[0] * x + view[1] * y + view[2], view[3] * x + view[4] * y + view[5]


@kernel
def list_in_window(window: Float64, frame: Float64, cell_start: Int32, cell_items: Int32, found: Bool) -> None:
    """Mark the items of the grid cells that a window touches.

    Args:
        window: (4,) min_x, min_y, max_x, max_y [m].
        frame, cell_start, cell_items: The grid, see ``roads.grid.Grid``.
        found: (K,) output, set True.
    """
    left, right, low, high = _cells_in_window(window, frame)
    for row in range(low, high + 1):
        for column in range(left, right + 1):
            cell = row * int(frame[3]) + column
            for place in range(cell_start[cell], cell_start[cell + 1]):
                found[cell_items[place]] = True


@kernel
def list_lines_in_window(
    window: Float64,
    frame: Float64,
    cell_types: UInt8,
    cell_rank: UInt8,
    block_start: Int32,
    filled_start: Int32,
    cell_items: Int32,
    found: Bool,
) -> None:
    """Mark the segments of the cells that a window touches; as above, with a ``roads.line_grid.LineGrid``."""
    left, right, low, high = _cells_in_window(window, frame)
    for row in range(low, high + 1):
        for column in range(left, right + 1):
            cell = row * int(frame[3]) + column
            if cell_types[cell]:
                filled = block_start[cell // CELLS_IN_BLOCK] + cell_rank[cell]
                for place in range(filled_start[filled], filled_start[filled + 1]):
                    found[cell_items[place]] = True


@device_function
def _cells_in_window(window: Float64, frame: Float64) -> tuple[int, int, int, int]:
    """Return the first and last column, and the first and last row, of the cells that a window touches."""
    left = int(larger(np.floor((window[0] - frame[0]) / frame[2]), 0.0))
    low = int(larger(np.floor((window[1] - frame[1]) / frame[2]), 0.0))
    right = int(smaller(np.floor((window[2] - frame[0]) / frame[2]), frame[3] - 1.0))
    high = int(smaller(np.floor((window[3] - frame[1]) / frame[2]), frame[4] - 1.0))
    return left, right, low, high


@kernel
def draw_polygons(
    outlines: Float32,
    offsets: Int32,
    types: UInt8,
    is_near: Bool,
    style: Int16,
    view: Float64,
    pictures: UInt8,
    turns: Int16,
) -> None:
    """Fill polygons.

    Args:
        outlines, offsets, types: (P, 2) [m], (M + 1,), (M,), see ``Roads``.
        is_near: (M,) polygons to draw.
        style, view, pictures: See above.
        turns: (H, W + 3) int16, zeros.
    """
    longest = 0
    for m in range(len(offsets) - 1):
        longest = larger(longest, offsets[m + 1] - offsets[m])
    pixels = np.empty((longest, 2))
    for m in range(len(offsets) - 1):
        channel = style[types[m], 0]
        if channel < 0 or not is_near[m]:
            continue
        for k in range(offsets[m], offsets[m + 1]):
            place = k - offsets[m]
            pixels[place, 0], pixels[place, 1] = to_pixel(view, outlines[k, 0], outlines[k, 1])
        fill(pixels, offsets[m + 1] - offsets[m], style[types[m], 1], pictures[channel], turns)


@kernel
def draw_segments(
    segments: Float32,
    types: UInt8,
    is_near: Bool,
    style: Int16,
    view: Float64,
    pictures: UInt8,
) -> None:
    """Draw segments (S, 4) [m] of types (S,), one pixel wide; the rest as in :func:`draw_polygons`."""
    for s in range(len(types)):
        channel = style[types[s], 0]
        if channel >= 0 and is_near[s]:
            x0, y0 = to_pixel(view, segments[s, 0], segments[s, 1])
            x1, y1 = to_pixel(view, segments[s, 2], segments[s, 3])
            draw_line(x0, y0, x1, y1, style[types[s], 1], pictures[channel])
