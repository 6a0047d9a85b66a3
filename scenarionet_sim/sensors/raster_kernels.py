"""Rasterisation of polygons and lines into images of bytes.

Images are (C, H, W), row 0 at the top; pixel (r, c) is the square from (c, r) to (c + 1, r + 1). Shapes have a type
code, and ``style`` (256, 2) gives the channel (-1 for none) and the pixel value of each type. A view (6,) maps metres
to pixels: column = v0 x + v1 y + v2, row = v3 x + v4 y + v5.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from scenarionet_data.arrays.dtypes import Bool, Float32, Float64, Int16, Int32, UInt8
from scenarionet_data.compiled.decorators import device_function, kernel
from scenarionet_sim.arrays.log import HEADING, X, Y
from scenarionet_sim.arrays.minmax import larger, smaller


class Crossings(NamedTuple):
    """Where an outline crosses the middles of H rows of W pixels; zeros before and after a polygon is filled.

    The turn of a crossing is 1 downwards and -1 upwards.
    """

    rows: Int16  # (H, 5) number of crossings, at most 3; column and turn of the first two
    turns: Int16  # (H, W + 3) of rows with more: sum of the turns at each column, and W - first and last such column

    @classmethod
    def none(cls, height: int, width: int) -> Crossings:
        """Return the memory for pictures of a size."""
        return cls(np.zeros((height, 5), np.int16), np.zeros((height, width + 3), np.int16))


@device_function
def fill(outline: Float64, count: int, value: int, picture: UInt8, crossings: Crossings) -> None:
    """Fill a closed outline: the pixels whose centre has a non-zero winding number.

    Args:
        outline: (count or more, 2) columns and rows.
        count: Number of points.
        value: Pixel value.
        picture: (H, W).
        crossings: Scratch memory.
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
            _cross(crossings.rows[row], crossings.turns[row], width, column, 1 if y1 > y0 else -1)
    for row in range(top, bottom + 1):
        found = crossings.rows[row]
        if found[0] == 2:  # the outline is closed: it turns back
            _fill_run(picture[row], smaller(found[1], found[3]), larger(found[1], found[3]), value)
        elif found[0]:
            _fill_between(picture[row], crossings.turns[row], width, value)
        found[0] = 0


@device_function
def _cross(found: Int16, turns: Int16, width: int, column: int, turn: int) -> None:
    """Note a crossing of a row before a column."""
    count = found[0]
    if count < 2:
        found[0], found[1 + 2 * count], found[2 + 2 * count] = count + 1, column, turn
        return
    if count == 2:
        _turn(turns, width, found[1], found[2])
        _turn(turns, width, found[3], found[4])
        found[0] = 3
    _turn(turns, width, column, turn)


@device_function
def _turn(turns: Int16, width: int, column: int, turn: int) -> None:
    turns[column] += turn
    turns[width + 1] = larger(turns[width + 1], width - column)
    turns[width + 2] = larger(turns[width + 2], column)


@device_function(in_lanes=True)
def _fill_run(pixels: UInt8, begin: int, end: int, value: int) -> None:
    """Fill the pixels of a row from ``begin`` to before ``end``."""
    for column in range(begin, end):
        pixels[column] = value


@device_function
def _fill_between(pixels: UInt8, turns: Int16, width: int, value: int) -> None:
    """Fill the pixels of a row around which the outline turns."""
    inside = 0
    for column in range(width - turns[width + 1], turns[width + 2] + 1):
        inside += turns[column]
        turns[column] = 0
        if inside != 0:
            pixels[column] = value
    turns[width + 1], turns[width + 2] = 0, 0


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


@device_function
def _window(view: Float64, pictures: UInt8) -> tuple[float, float, float, float]:
    """Return the bounding box min_x, min_y, max_x, max_y [m] of pictures with a margin of a pixel."""
    height, width = pictures.shape[1], pictures.shape[2]
    area = view[0] * view[4] - view[1] * view[3]
    low_x, low_y, high_x, high_y = np.inf, np.inf, -np.inf, -np.inf
    for k in range(4):
        column, row = (width + 1.0 if k % 2 else -1.0) - view[2], (height + 1.0 if k > 1 else -1.0) - view[5]
        x, y = (view[4] * column - view[1] * row) / area, (view[0] * row - view[3] * column) / area
        low_x, low_y, high_x, high_y = smaller(low_x, x), smaller(low_y, y), larger(high_x, x), larger(high_y, y)
    return low_x, low_y, high_x, high_y


@kernel
def draw_polygons(
    outlines: Float32,
    offsets: Int32,
    types: UInt8,
    bounds: Float32,
    style: Int16,
    view: Float64,
    pictures: UInt8,
    crossings: Crossings,
) -> None:
    """Fill polygons.

    Args:
        outlines, offsets, types: (P, 2) [m], (M + 1,), (M,), see ``Roads``.
        bounds: (M, 4) min_x, min_y, max_x, max_y [m].
        style, view, pictures: See above.
        crossings: Scratch memory for pictures of this size.
    """
    longest = 0
    for m in range(len(offsets) - 1):
        longest = larger(longest, offsets[m + 1] - offsets[m])
    pixels, (low_x, low_y, high_x, high_y) = np.empty((longest, 2)), _window(view, pictures)
    for m in range(len(offsets) - 1):
        channel, box = style[types[m], 0], bounds[m]
        if channel < 0 or box[0] > high_x or box[1] > high_y or box[2] < low_x or box[3] < low_y:
            continue
        for k in range(offsets[m], offsets[m + 1]):
            place = k - offsets[m]
            pixels[place, 0], pixels[place, 1] = to_pixel(view, outlines[k, 0], outlines[k, 1])
        fill(pixels, offsets[m + 1] - offsets[m], style[types[m], 1], pictures[channel], crossings)


@kernel
def draw_segments(segments: Float32, types: UInt8, style: Int16, view: Float64, pictures: UInt8) -> None:
    """Draw segments (S, 4) [m] of types (S,), one pixel wide; the rest as in :func:`draw_polygons`."""
    low_x, low_y, high_x, high_y = _window(view, pictures)
    for s in range(len(types)):
        channel, (x0, y0, x1, y1) = style[types[s], 0], (segments[s, 0], segments[s, 1], segments[s, 2], segments[s, 3])
        is_beside = larger(x0, x1) < low_x or smaller(x0, x1) > high_x
        if channel >= 0 and not (is_beside or larger(y0, y1) < low_y or smaller(y0, y1) > high_y):
            start, end = to_pixel(view, x0, y0), to_pixel(view, x1, y1)
            draw_line(start[0], start[1], end[0], end[1], style[types[s], 1], pictures[channel])


@kernel
def draw_boxes(
    motion: Float64,
    size: Float64,
    types: UInt8,
    is_drawn: Bool,
    style: Int16,
    view: Float64,
    pictures: UInt8,
    crossings: Crossings,
) -> None:
    """Fill boxes.

    Args:
        motion: (N, 4 or more) x, y, z [m] and heading [rad]; columns as in ``arrays.log``.
        size: (N, 3) length, width, height [m].
        types: (N,) types.
        is_drawn: (N,) boxes to draw.
        style, view, pictures, crossings: As in :func:`draw_polygons`.
    """
    corners = np.empty((4, 2))
    for n in range(len(types)):
        channel = style[types[n], 0]
        if channel < 0 or not is_drawn[n]:
            continue
        cos, sin = np.cos(motion[n, HEADING]), np.sin(motion[n, HEADING])
        for k in range(4):  # counter-clockwise from the front left
            x = size[n, 0] * (0.5 if k in (0, 3) else -0.5)
            y = size[n, 1] * (0.5 if k < 2 else -0.5)
            east, north = x * cos - y * sin + motion[n, X], x * sin + y * cos + motion[n, Y]
            corners[k, 0], corners[k, 1] = to_pixel(view, east, north)
        fill(corners, 4, style[types[n], 1], pictures[channel], crossings)
