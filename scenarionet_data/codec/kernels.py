"""Compiled loops of decoding: one call checks and fills the arrays of a scenario's tracks, lights or map.

They take for granted that the rows are consistent in themselves, as all blocks are; lists of different columns may
differ in length, which is checked before they are read.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from scenarionet_data.arrays.byte_views import as_float32, as_int32
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
    for scenario in range(len(steps)):
        if not _are_inside(block, start, lists, bounds[scenario], bounds[scenario + 1], steps[scenario]):
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
        for scenario in range(len(bounds) - 1):
            first, last = bounds[scenario], bounds[scenario + 1]
            if not _are_as_long(block, likes[place], columns[place], others[place], first, last):
                return place
    return len(columns)


@device_function
def _are_inside(block: ColumnBlock, start: int, lists: int, first: int, last: int, steps: int) -> bool:
    """Whether the spans of a scenario's objects are within its timesteps."""
    starts = block.words[block.firsts[start] :]
    for row in range(first, last):
        begin = np.int64(np.int32(starts[row]))
        if begin < 0 or begin + block.lists[0, lists, row] > steps:
            return False
    return True


@device_function
def _are_as_long(block: ColumnBlock, like: int, column: int, other: int, first: int, last: int) -> bool:
    """Whether the lists of a scenario are as long as those of another column, or have another length they may have."""
    wanted, lengths, offsets = block.lists[0, like], block.lists[0, column], block.lists[1, column]
    may_be_none = other == OR_NONE or (other == OR_NEVER and offsets[first] == offsets[last])
    for row in range(first, last):
        length = lengths[row]
        if length != wanted[row]:
            is_other = length == 1 if other == OR_ONE else length == 0 and may_be_none
            if not is_other:
                return False
    return True


@kernel(nogil=True, allocates=False)
def fill_tracks(
    block: ColumnBlock,
    columns: Array,
    others: Array,
    first: int,
    last: int,
    steps: int,
    codes: Array,
    memory: Array,
    places: tuple[int, ...],
) -> int:
    """Scatter the lists of a scenario's objects to their timesteps, and copy what they have one of.

    Args:
        block: Rows of tracks.
        columns: (17,) int64 columns x, y, z, heading, vx, vy, length, width, height, valid, is_interpolated, start,
            object_type, is_size_assumed, is_type_assumed, is_velocity_estimated, source_type.
        others: (11,) int64 lengths that the lists may have besides that of x, see :func:`check_lengths`.
        first, last: Rows of the scenario.
        steps: Its number of timesteps.
        codes: uint8 code of each word of object_type.
        memory: uint8 zeros, filled.
        places: Those of the arrays of ``StoredTracks``.

    Returns:
        Place in ``columns`` of the first that does not match the spans of the scenario, or their number.
    """
    if not _are_inside(block, columns[_START], columns[0], first, last, steps):
        return _START
    for place in range(len(others)):
        if not _are_as_long(block, columns[0], columns[place], others[place], first, last):
            return place
    numbers, integers = as_float32(memory), as_int32(memory)
    position, velocity = places[2] >> 2, places[3] >> 2
    size, heading = numbers[places[4] >> 2 : places[5] >> 2], numbers[places[5] >> 2 : places[6] >> 2]
    valid = memory[places[7] : places[8]]
    starts = block.words[block.firsts[columns[_START]] + first :]
    for row in range(last - first):
        count = np.int64(block.lists[0, columns[0], first + row])
        begin = row * steps + np.int64(starts[row])
        end = begin + count
        for kind in range(2):
            flags = memory[places[7 + kind] + begin : places[7 + kind] + end]
            _fill_flags(block, columns[9 + kind], first + row, kind == 0, flags)
        start, headings = _element(block, columns[3], first + row), heading[begin:end]
        values = block.numbers[start : start + count]
        for k in range(len(values)):
            headings[k] = values[k]
        has_z = block.lists[0, columns[2], first + row] == count
        if has_z:
            _join_points(block, columns[:3], first + row, count, numbers[position + 3 * begin : position + 3 * end])
        for kind in range(1 if has_z else 0, 2):  # without heights, z stays 0
            width, start = 3 - kind, position if kind == 0 else velocity
            points = numbers[start + width * begin : start + width * end]
            _join_pairs(block, columns[4 * kind : 4 * kind + 2], first + row, count, points, width)
        _fill_sizes(block, columns[6:9], first + row, valid[begin:end], size[3 * begin : 3 * end])
    _copy_codes(block, columns[12], first, codes, memory[places[9] : places[10]])
    for flag in range(3):
        _copy_flags(block, columns[13 + flag], first, memory[places[10 + flag] : places[11 + flag]])
    source_type = integers[places[6] >> 2 : places[7] >> 2]
    words = block.words[block.firsts[columns[16]] + first :]
    for row in range(len(source_type)):
        source_type[row] = words[row]
    return len(columns)


_START = 11


@device_function
def _element(block: ColumnBlock, column: int, row: int) -> Any:
    """Place of the first element of a list."""
    return block.firsts[column] + block.lists[1, column, row]


@device_function
def _join_points(block: ColumnBlock, columns: Array, row: int, count: Any, points: Array) -> None:
    """Fill points, (3 * n,), with their coordinates from a row on."""
    x, y, z = _element(block, columns[0], row), _element(block, columns[1], row), _element(block, columns[2], row)
    numbers = block.numbers
    _interleave(numbers[x : x + count], numbers[y : y + count], numbers[z : z + count], points)


@device_function(in_lanes=True)
def _interleave(x: Array, y: Array, z: Array, points: Array) -> None:
    for k in range(len(x)):
        points[3 * k] = x[k]
        points[3 * k + 1] = y[k]
        points[3 * k + 2] = z[k]


@device_function
def _join_pairs(block: ColumnBlock, columns: Array, row: int, count: Any, points: Array, width: int) -> None:
    """Fill the first two of the ``width`` coordinates of points, (width * n,)."""
    first, second = _element(block, columns[0], row), _element(block, columns[1], row)
    x, y = block.numbers[first : first + count], block.numbers[second : second + count]
    for k in range(len(x)):
        points[width * k], points[width * k + 1] = x[k], y[k]


@device_function
def _fill_sizes(block: ColumnBlock, columns: Array, row: int, valid: Array, sizes: Array) -> None:
    """Fill extents, (3 * n,), at the valid timesteps of a span; a list of one element holds at all of them."""
    x, y, z = _element(block, columns[0], row), _element(block, columns[1], row), _element(block, columns[2], row)
    lengths, numbers = block.lists[0, :, row], block.numbers
    by_x, by_y, by_z = lengths[columns[0]] > 1, lengths[columns[1]] > 1, lengths[columns[2]] > 1
    for k in range(len(valid)):
        if valid[k]:
            sizes[3 * k], sizes[3 * k + 1] = numbers[x + by_x * k], numbers[y + by_y * k]
            sizes[3 * k + 2] = numbers[z + by_z * k]


@device_function
def _fill_flags(block: ColumnBlock, column: int, row: int, default: bool, out: Array) -> None:
    """Fill the flags of a span, which are False: the listed ones, or ``default`` where there is no list."""
    start, count = _element(block, column, row), block.lists[0, column, row]
    if count:
        for k in range(count):
            out[k] = block.bits[start + k] != 0
    elif default:
        for k in range(len(out)):
            out[k] = True


@device_function
def _copy_codes(block: ColumnBlock, column: int, first: int, codes: Array, out: Array) -> None:
    """Fill codes of the words from an element on."""
    words = block.words[block.firsts[column] + first :]
    for k in range(len(out)):
        out[k] = codes[np.int32(words[k])]


@device_function
def _copy_flags(block: ColumnBlock, column: int, first: int, out: Array) -> None:
    bits = block.bits[block.firsts[column] + first :]
    for k in range(len(out)):
        out[k] = bits[k] != 0


@kernel(nogil=True, allocates=False)
def fill_lights(
    block: ColumnBlock,
    columns: Array,
    first: int,
    last: int,
    steps: int,
    states: Array,
    provenances: Array,
    memory: Array,
    places: tuple[int, ...],
) -> bool:
    """Fill a scenario's lights.

    Args:
        block: Rows of lights.
        columns: (6,) int64 columns stop_x, stop_y, stop_z, state, is_lane_in_map, provenance.
        first, last: Rows of the scenario.
        steps: Its number of timesteps.
        states, provenances: uint8 code of each word of these columns.
        memory: uint8, filled; known stop points without a height have z = 0, like all other coordinates.
        places: Those of the arrays of ``StoredLights``.

    Returns:
        Whether there is one state per timestep.
    """
    for row in range(first, last):
        if block.lists[0, columns[3], row] != steps:
            return False
    points = as_float32(memory)[places[2] >> 2 : places[3] >> 2]
    for row in range(last - first):
        for axis in range(3):
            points[3 * row + axis] = block.numbers[block.firsts[columns[axis]] + first + row]
        if np.isnan(points[3 * row + 2]) and not np.isnan(points[3 * row]):
            points[3 * row + 2] = 0
    _copy_codes(block, columns[3], block.lists[1, columns[3], first], states, memory[places[3] : places[4]])
    _copy_flags(block, columns[4], first, memory[places[4] : places[5]])
    _copy_codes(block, columns[5], first, provenances, memory[places[5] : places[6]])
    return True


@kernel(nogil=True, allocates=False)
def fill_features(
    block: ColumnBlock,
    columns: Array,
    first: int,
    last: int,
    codes: Array,
    memory: Array,
    places: tuple[int, ...],
) -> int:
    """Fill a scenario's map features: lists of points from lists of their coordinates; without these, they are 0.

    Args:
        block: Rows of maps.
        columns: (11,) int64 columns x, y, z, polygon_x, polygon_y, polygon_z, width_left, width_right, speed_limit,
            feature_type, is_intersection.
        first, last: Rows of the scenario.
        codes: uint8 code of each word of feature_type.
        memory: uint8, filled.
        places: Those of the arrays of ``StoredFeatures``.

    Returns:
        Place in ``columns`` of the first whose lists do not match its polylines, or their number.
    """
    for place in range(8):
        if not _are_as_long(block, columns[place - place % 3], columns[place], OR_NONE, first, last):
            return place
    numbers, integers = as_float32(memory), as_int32(memory)
    for kind in range(3):
        offsets = integers[places[6 + kind] >> 2 : places[7 + kind] >> 2]
        points = numbers[places[2 + kind] >> 2 : places[3 + kind] >> 2]
        _fill_points(block, columns[3 * kind : min(3 * kind + 3, 8)], first, offsets, points)
    speed_limit, is_intersection = numbers[places[5] >> 2 : places[6] >> 2], memory[places[10] : places[11]]
    limits, bits = block.firsts[columns[8]] + first, block.firsts[columns[10]] + first
    for row in range(last - first):
        speed_limit[row] = block.numbers[limits + row]
        is_intersection[row] = block.bits[bits + row]
    _copy_codes(block, columns[9], first, codes, memory[places[9] : places[10]])
    return len(columns)


@device_function
def _fill_points(block: ColumnBlock, columns: Array, first: int, offsets: Array, points: Array) -> None:
    """Fill offsets as of ``Ragged`` and points, (2 or 3 * number of points,)."""
    width, ends = len(columns), block.lists[1, columns[0]]
    for row in range(len(offsets)):
        offsets[row] = ends[first + row] - ends[first]
    is_full = width == 3
    for axis in range(width):
        found = block.lists[1, columns[axis], first + len(offsets) - 1] - block.lists[1, columns[axis], first]
        is_full &= width * found == len(points)
    if is_full:
        _join_points(block, columns, first, len(points) // 3, points)
        return
    for axis in range(width):
        for row in range(len(offsets) - 1):
            start, has_values = (
                _element(block, columns[axis], first + row),
                block.lists[0, columns[axis], first + row] > 0,
            )
            for k in range(offsets[row + 1] - offsets[row]):
                points[width * (offsets[row] + k) + axis] = block.numbers[start + k] if has_values else 0


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
