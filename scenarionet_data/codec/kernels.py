"""Compiled loops of decoding: one call checks and fills the arrays of a scenario's tracks, lights or map.

They take for granted that the rows are consistent in themselves, as all blocks are; lists of different columns may
differ in length, which is checked before they are read.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from scenarionet_data.arrays.columns import ColumnBlock
from scenarionet_data.arrays.compiled import device_function, kernel
from scenarionet_data.arrays.dtypes import Array
from scenarionet_data.codec.text_kernels import TextArrays, copy_texts

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


class TrackArrays(NamedTuple):
    """Fields of ``Tracks``; those over time are zeros until they are filled."""

    position: Array  # (N, T, 3) float32
    heading: Array  # (N, T) float32
    velocity: Array  # (N, T, 2) float32
    size: Array  # (N, T, 3) float32
    valid: Array  # (N, T) bool
    is_interpolated: Array  # (N, T) bool
    object_type: Array  # (N,) uint8
    is_size_assumed: Array  # (N,) bool
    is_type_assumed: Array  # (N,) bool
    is_velocity_estimated: Array  # (N,) bool
    source_type: Array  # (N,) int32 numbers of words, or -1


@kernel(nogil=True, allocates=False)
def fill_tracks(
    block: ColumnBlock, columns: Array, others: Array, first: int, codes: Array, out: TrackArrays, texts: TextArrays
) -> int:
    """Scatter the lists of a scenario's objects to their timesteps, and copy what they have one of.

    Args:
        block: Rows of tracks.
        columns: (17,) int64 columns x, y, z, heading, vx, vy, length, width, height, valid, is_interpolated, start,
            object_type, is_size_assumed, is_type_assumed, is_velocity_estimated, source_type.
        others: (11,) int64 lengths that the lists may have besides that of x, see :func:`check_lengths`.
        first: Row of the scenario's first object.
        codes: uint8 code of each word of object_type.
        out: Filled.
        texts: Filled.

    Returns:
        Place in ``columns`` of the first that does not match the spans of the scenario, or their number.
    """
    last, steps = first + out.heading.shape[0], out.heading.shape[1]
    if not _are_inside(block, columns[_START], columns[0], first, last, steps):
        return _START
    for place in range(len(others)):
        if not _are_as_long(block, columns[0], columns[place], others[place], first, last):
            return place
    cells = len(out.heading) * steps
    heading, valid, is_interpolated = (
        out.heading.reshape(cells),
        out.valid.reshape(cells),
        out.is_interpolated.reshape(cells),
    )
    position, size = out.position.reshape(3 * cells), out.size.reshape(3 * cells)
    velocity = out.velocity.reshape(2 * cells)
    starts = block.words[block.firsts[columns[_START]] + first :]
    for row in range(len(out.heading)):
        count = np.int64(block.lists[0, columns[0], first + row])
        begin = row * steps + np.int64(starts[row])
        end = begin + count
        _fill_flags(block, columns[9], first + row, True, valid[begin:end])
        _fill_flags(block, columns[10], first + row, False, is_interpolated[begin:end])
        start, headings = _element(block, columns[3], first + row), heading[begin:end]
        values = block.numbers[start : start + count]
        for k in range(len(values)):
            headings[k] = values[k]
        if block.lists[0, columns[2], first + row] == count:
            _join_points(block, columns[:3], first + row, count, position[3 * begin : 3 * end])
        else:  # z stays 0
            _join_pairs(block, columns[:2], first + row, count, position[3 * begin : 3 * end], 3)
        _join_pairs(block, columns[4:6], first + row, count, velocity[2 * begin : 2 * end], 2)
        _fill_sizes(block, columns[6:9], first + row, valid[begin:end], size[3 * begin : 3 * end])
    _copy_codes(block, columns[12], first, codes, out.object_type)
    _copy_flags(block, columns[13], first, out.is_size_assumed)
    _copy_flags(block, columns[14], first, out.is_type_assumed)
    _copy_flags(block, columns[15], first, out.is_velocity_estimated)
    words = block.words[block.firsts[columns[16]] + first :]
    for row in range(len(out.source_type)):
        out.source_type[row] = words[row]
    copy_texts(block, first, texts)
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
    for axis in range(3):
        start, count = _element(block, columns[axis], row), block.lists[0, columns[axis], row]
        values, step = block.numbers[start : start + count], 0 if count == 1 else 1
        for k in range(len(valid)):
            if valid[k]:
                sizes[3 * k + axis] = values[step * k]


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


class LightArrays(NamedTuple):
    """Fields of ``Lights``."""

    stop_point: Array  # (L, 3) float32
    state: Array  # (L, T) uint8
    is_lane_in_map: Array  # (L,) bool
    provenance: Array  # (L,) uint8


@kernel(nogil=True, allocates=False)
def fill_lights(
    block: ColumnBlock,
    columns: Array,
    first: int,
    states: Array,
    provenances: Array,
    out: LightArrays,
    texts: TextArrays,
) -> bool:
    """Fill a scenario's lights.

    Args:
        block: Rows of lights.
        columns: (6,) int64 columns stop_x, stop_y, stop_z, state, is_lane_in_map, provenance.
        first: First row.
        states, provenances: uint8 code of each word of these columns.
        out: Filled; known stop points without a height have z = 0, like all other coordinates.
        texts: Filled.

    Returns:
        Whether there is one state per timestep.
    """
    count, steps = out.state.shape
    for row in range(first, first + count):
        if block.lists[0, columns[3], row] != steps:
            return False
    points = out.stop_point
    for row in range(count):
        for axis in range(3):
            points[row, axis] = block.numbers[block.firsts[columns[axis]] + first + row]
        if np.isnan(points[row, 2]) and not np.isnan(points[row, 0]):
            points[row, 2] = 0
    _copy_codes(block, columns[3], block.lists[1, columns[3], first], states, out.state.reshape(count * steps))
    _copy_flags(block, columns[4], first, out.is_lane_in_map)
    _copy_codes(block, columns[5], first, provenances, out.provenance)
    copy_texts(block, first, texts)
    return True


class FeatureArrays(NamedTuple):
    """Fields of ``MapFeatures``; offsets and points are those of ``Ragged``."""

    line_offsets: Array  # (M + 1,) int32
    line: Array  # (P, 3) float32
    outline_offsets: Array  # (M + 1,) int32
    outline: Array  # (Q, 3) float32
    width_offsets: Array  # (M + 1,) int32
    width: Array  # (K, 2) float32
    speed_limit: Array  # (M,) float32
    feature_type: Array  # (M,) uint8
    is_intersection: Array  # (M,) int8


@kernel(nogil=True, allocates=False)
def fill_features(
    block: ColumnBlock, columns: Array, first: int, codes: Array, out: FeatureArrays, texts: TextArrays
) -> int:
    """Fill a scenario's map features: lists of points from lists of their coordinates; without these, they are 0.

    Args:
        block: Rows of maps.
        columns: (11,) int64 columns x, y, z, polygon_x, polygon_y, polygon_z, width_left, width_right, speed_limit,
            feature_type, is_intersection.
        first: First row.
        codes: uint8 code of each word of feature_type.
        out: Filled.
        texts: Filled.

    Returns:
        Place in ``columns`` of the first whose lists do not match its polylines, or their number.
    """
    count = len(out.speed_limit)
    for place in range(8):
        if not _are_as_long(block, columns[place - place % 3], columns[place], OR_NONE, first, first + count):
            return place
    _fill_points(block, columns[:3], first, out.line_offsets, out.line)
    _fill_points(block, columns[3:6], first, out.outline_offsets, out.outline)
    _fill_points(block, columns[6:8], first, out.width_offsets, out.width)
    limits, bits = block.firsts[columns[8]] + first, block.firsts[columns[10]] + first
    for row in range(count):
        out.speed_limit[row] = block.numbers[limits + row]
        out.is_intersection[row] = block.bits[bits + row]
    _copy_codes(block, columns[9], first, codes, out.feature_type)
    copy_texts(block, first, texts)
    return len(columns)


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
        _join_points(block, columns, first, len(points), points.reshape(3 * len(points)))
        return
    for axis in range(len(columns)):
        for row in range(len(offsets) - 1):
            target, start = points[offsets[row] : offsets[row + 1]], _element(block, columns[axis], first + row)
            has_values = block.lists[0, columns[axis], first + row] > 0
            for k in range(len(target)):
                target[k, axis] = block.numbers[start + k] if has_values else 0


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
