"""Compiled loops of decoding and encoding; they do not check their arguments."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from scenarionet_data.arrays.columns import ColumnBlock
from scenarionet_data.arrays.compiled import device_function, kernel
from scenarionet_data.arrays.dtypes import Array

EQUAL, OR_ONE, OR_NONE, OR_NEVER = range(4)
"""Lengths that a list may have: that of its span; or 1; or 0; or 0 if those of its scenario all have it."""


@kernel(nogil=True, allocates=False)
def check_spans(block: ColumnBlock, start: int, lists: int, bounds: Array, steps: Array) -> bool:
    """Whether the spans of objects are within their scenarios.

    Args:
        block: Rows of tracks.
        start: Column of the first timestep of each span.
        lists: Column of lists of the length of each span.
        bounds: (scenarios + 1,) int64 first row of each scenario, and the end of the last one.
        steps: (scenarios,) int64 number of timesteps.
    """
    starts = block.words[block.firsts[start] : block.firsts[start] + block.counts[start]]
    for scenario in range(len(steps)):
        for row in range(bounds[scenario], bounds[scenario + 1]):
            begin = np.int64(np.int32(starts[row]))
            if begin < 0 or begin + block.lists[0, lists, row] > steps[scenario]:
                return False
    return True


@kernel(nogil=True, allocates=False)
def check_lengths(block: ColumnBlock, likes: Array, columns: Array, others: Array, bounds: Array) -> int:
    """Compare the lengths of lists with those of other columns.

    Args:
        block: Rows of scenarios.
        likes: (n,) int64 the other column of each column.
        columns: (n,) int64 the columns.
        others: (n,) int64 other lengths that their lists may have: OR_ONE, ...
        bounds: As in :func:`check_spans`.

    Returns:
        Place in ``columns`` of the first that differs, or n.
    """
    for place in range(len(columns)):
        lengths, offsets, other = block.lists[0, columns[place]], block.lists[1, columns[place]], others[place]
        for scenario in range(len(bounds) - 1):
            first, last = bounds[scenario], bounds[scenario + 1]
            may_be_none = other == OR_NONE or (other == OR_NEVER and offsets[first] == offsets[last])
            for row in range(first, last):
                length = lengths[row]
                if length != block.lists[0, likes[place], row]:
                    is_other = length == 1 if other == OR_ONE else length == 0 and may_be_none
                    if not is_other:
                        return place
    return len(columns)


class Grids(NamedTuple):
    """Arrays over time of N objects, zeros until they are filled."""

    position: Array  # (N, T, 3) float32
    heading: Array  # (N, T) float32
    velocity: Array  # (N, T, 2) float32
    size: Array  # (N, T, 3) float32
    valid: Array  # (N, T) bool
    is_interpolated: Array  # (N, T) bool


@kernel(nogil=True, allocates=False)
def fill_grids(block: ColumnBlock, columns: Array, first: int, out: Grids) -> None:
    """Scatter the lists of a scenario's objects to their timesteps.

    Args:
        block: Rows of tracks, which :func:`check_spans` and :func:`check_lengths` have checked.
        columns: (12,) int64 columns start, x, y, z, heading, vx, vy, length, width, height, valid, is_interpolated.
        first: Row of the scenario's first object.
        out: Filled.
    """
    starts = block.words[block.firsts[columns[0]] :]
    for row in range(len(out.heading)):
        begin, count = np.int64(starts[first + row]), np.int64(block.lists[0, columns[1], first + row])
        span = slice(begin, begin + count)
        position, velocity, size = out.position[row, span], out.velocity[row, span], out.size[row, span]
        heading, valid = out.heading[row, span], out.valid[row, span]
        if block.lists[0, columns[3], first + row] == count:
            _join_points(block, columns[1:4], first + row, count, position)
        else:  # z stays 0
            for axis in range(2):
                _copy_list(block, columns[1 + axis], first + row, position, axis)
        start = _element(block, columns[4], first + row)
        values = block.numbers[start : start + count]
        for k in range(count):
            heading[k] = values[k]
        for axis in range(2):
            _copy_list(block, columns[5 + axis], first + row, velocity, axis)
        _fill_flags(block, columns[10], first + row, True, valid)
        _fill_flags(block, columns[11], first + row, False, out.is_interpolated[row, span])
        for axis in range(3):
            _fill_size(block, columns[7 + axis], first + row, valid, size, axis)


@device_function
def _element(block: ColumnBlock, column: int, row: int) -> Any:
    """Place of the first element of a list."""
    return block.firsts[column] + block.lists[1, column, row]


@device_function
def _copy_list(block: ColumnBlock, column: int, row: int, points: Array, axis: int) -> None:
    """Copy a list of coordinates to points, (n, 2 or 3); an empty list to none of them."""
    start = _element(block, column, row)
    values = block.numbers[start : start + block.lists[0, column, row]]
    for k in range(len(values)):
        points[k, axis] = values[k]


@device_function
def _join_points(block: ColumnBlock, columns: Array, row: int, count: Any, points: Array) -> None:
    """Fill points, (n, 3), with their coordinates from a row on."""
    x, y, z = _element(block, columns[0], row), _element(block, columns[1], row), _element(block, columns[2], row)
    numbers = block.numbers
    _interleave(numbers[x : x + count], numbers[y : y + count], numbers[z : z + count], points.reshape(3 * count))


@device_function(in_lanes=True)
def _interleave(x: Array, y: Array, z: Array, points: Array) -> None:
    for k in range(len(x)):
        points[3 * k] = x[k]
        points[3 * k + 1] = y[k]
        points[3 * k + 2] = z[k]


@device_function
def _fill_size(block: ColumnBlock, column: int, row: int, valid: Array, size: Array, axis: int) -> None:
    """Fill an extent at the valid timesteps of a span; a list of one element holds at all of them."""
    start, count = _element(block, column, row), block.lists[0, column, row]
    values = block.numbers[start : start + count]
    if count == 1:
        for k in range(len(valid)):
            size[k, axis] = values[0] if valid[k] else 0
    else:
        for k in range(len(values)):
            size[k, axis] = values[k] if valid[k] else 0


@device_function
def _fill_flags(block: ColumnBlock, column: int, row: int, default: bool, out: Array) -> None:
    """Fill the flags of a span: the listed ones, or ``default`` where there is no list."""
    start, count = _element(block, column, row), block.lists[0, column, row]
    flags = block.bits[start : start + count]
    for k in range(len(out)):
        out[k] = flags[k] != 0 if count else default


class FeaturePoints(NamedTuple):
    """Points of M map features; offsets are those of ``Ragged``."""

    line_offsets: Array  # (M + 1,) int32
    line: Array  # (P, 3) float32
    outline_offsets: Array  # (M + 1,) int32
    outline: Array  # (Q, 3) float32
    width_offsets: Array  # (M + 1,) int32
    width: Array  # (K, 2) float32


@kernel(nogil=True, allocates=False)
def fill_lines(block: ColumnBlock, columns: Array, first: int, out: FeaturePoints) -> None:
    """Fill lists of points from lists of their coordinates; those without elements in a row are 0.

    Args:
        block: Rows of maps, which :func:`check_lengths` has checked.
        columns: (8,) int64 columns x, y, z, polygon_x, polygon_y, polygon_z, width_left, width_right.
        first: First row.
        out: Filled.
    """
    _fill_points(block, columns[:3], first, out.line_offsets, out.line)
    _fill_points(block, columns[3:6], first, out.outline_offsets, out.outline)
    _fill_points(block, columns[6:], first, out.width_offsets, out.width)


@device_function
def _fill_points(block: ColumnBlock, columns: Array, first: int, offsets: Array, points: Array) -> None:
    ends = block.lists[1, columns[0]]
    for row in range(len(offsets)):
        offsets[row] = ends[first + row] - ends[first]
    is_full = len(columns) == 3
    for axis in range(len(columns)):
        found = block.lists[1, columns[axis], first + len(offsets) - 1] - block.lists[1, columns[axis], first]
        is_full &= found == len(points)
    if is_full:
        _join_points(block, columns, first, len(points), points)
        return
    for axis in range(len(columns)):
        for row in range(len(offsets) - 1):
            target = points[offsets[row] : offsets[row + 1]]
            if block.lists[0, columns[axis], first + row]:
                _copy_list(block, columns[axis], first + row, target, axis)
            else:
                for k in range(len(target)):
                    target[k, axis] = 0


@kernel(nogil=True, allocates=False)
def have_steps(block: ColumnBlock, column: int, bounds: Array, steps: Array) -> bool:
    """Whether all lists of a column have one element for each timestep of their scenario.

    Args:
        block: Rows of scenarios.
        column: The column.
        bounds, steps: As in :func:`check_spans`.
    """
    for scenario in range(len(steps)):
        for row in range(bounds[scenario], bounds[scenario + 1]):
            if block.lists[0, column, row] != steps[scenario]:
                return False
    return True


@kernel(nogil=True, allocates=False)
def fill_stop_points(numbers: Array, firsts: Array, points: Array) -> None:
    """Fill stop points.

    Args:
        numbers: float32 words of a block.
        firsts: (3,) int64 place of x, y and z of its first row.
        points: (L, 3) float32, filled; known points without a height have z = 0, like all other coordinates.
    """
    for row in range(len(points)):
        for axis in range(3):
            points[row, axis] = numbers[firsts[axis] + row]
        if np.isnan(points[row, 2]) and not np.isnan(points[row, 0]):
            points[row, 2] = 0


@kernel(nogil=True)
def find_bounds(offsets: Array, points: Array, bounds: Array) -> None:
    """Extend each row's bounding box by the points of its list.

    Args:
        offsets: (M + 1,) int32, see ``Ragged``.
        points: (P, 3) float32.
        bounds: (M, 4) float32 min_x, min_y, max_x, max_y, extended; NaN without points.
    """
    for row in range(len(offsets) - 1):
        for point in range(offsets[row], offsets[row + 1]):
            for axis in range(2):
                value = points[point, axis]
                # "not >=" rather than "<": the first point replaces NaN.
                if not value >= bounds[row, axis]:
                    bounds[row, axis] = value
                if not value <= bounds[row, axis + 2]:
                    bounds[row, axis + 2] = value
