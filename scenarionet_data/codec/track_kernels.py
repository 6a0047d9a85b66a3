"""Compiled loop of decoding tracks: one call checks the rows of a scenario and fills its arrays.

It takes for granted that the rows are consistent in themselves, as all blocks are; lists of different columns may
differ in length, which is checked before they are read.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from scenarionet_data.arrays.columns import FIRST, LENGTHS, ColumnBlock
from scenarionet_data.arrays.dtypes import Array
from scenarionet_data.codec.check_kernels import TRACK_LISTS, are_as_long, are_inside
from scenarionet_data.codec.copy_kernels import copy, copy_codes, copy_flags, element, join_points
from scenarionet_data.codec.part_kernels import PartPlan, copy_texts
from scenarionet_data.compiled.byte_views import as_float32, as_int32, as_int64
from scenarionet_data.compiled.decorators import device_function, kernel

_START = 11
_OTHERS = tuple(TRACK_LISTS.values())
_NONE = np.float32(0)


@kernel(nogil=True, allocates=False)
def fill_tracks(
    block: ColumnBlock,
    plan: PartPlan,
    first: int,
    last: int,
    steps: int,
    codes: tuple[Array],
    memory: Array,
    places: Array,
) -> int:
    """Scatter the lists of a scenario's objects to their timesteps, and copy what they have one of.

    Args:
        block: Rows of tracks.
        plan: Columns and arrays of ``StoredTracks``.
        first, last: Rows of the scenario.
        steps: Its number of timesteps.
        codes: uint8 code of each word of object_type.
        memory: uint8, filled; what is in no span is 0.
        places: Those of the arrays of ``StoredTracks``.

    Returns:
        Place in the plan's columns of the first that does not match the spans of the scenario, or their number.
    """
    columns = plan.columns
    if not are_inside(block, columns[_START], columns[0], first, last, steps):
        return _START
    for place in range(len(_OTHERS)):
        if not are_as_long(block, columns[0], columns[place], _OTHERS[place], first, last):
            return place
    _clear(as_int64(memory)[: places[len(places) - 2] + 7 >> 3])
    numbers, integers = as_float32(memory), as_int32(memory)
    position, velocity = places[2] >> 2, places[3] >> 2
    size, heading = numbers[places[4] >> 2 : places[5] >> 2], numbers[places[5] >> 2 : places[6] >> 2]
    valid = memory[places[7] : places[8]]
    values, words = as_float32(block.memory), as_int32(block.memory)
    starts = words[block.columns[columns[_START], FIRST] + first :]
    lengths = words[block.columns[columns[0], LENGTHS] + first :]
    heights = words[block.columns[columns[2], LENGTHS] + first :]
    for row in range(last - first):
        count = np.int64(lengths[row])
        begin = row * steps + starts[row]
        end = begin + count
        for kind in range(2):
            flags = memory[places[7 + kind] + begin : places[7 + kind] + end]
            _fill_flags(block, columns[9 + kind], first + row, kind == 0, flags)
        start = element(block, columns[3], first + row)
        copy(values[start : start + count], heading[begin:end])
        has_z = heights[row] == count
        if has_z:
            join_points(block, columns[:3], first + row, count, numbers[position + 3 * begin : position + 3 * end])
        for kind in range(1 if has_z else 0, 2):  # without heights, z stays 0
            width, start = 3 - kind, position if kind == 0 else velocity
            points = numbers[start + width * begin : start + width * end]
            _join_pairs(block, columns[4 * kind : 4 * kind + 2], first + row, count, points, width)
        _fill_sizes(block, columns[6:9], first + row, valid[begin:end], size[3 * begin : 3 * end])
    copy_codes(block, columns[12], first, codes[0], memory[places[9] : places[10]])
    for flag in range(3):
        copy_flags(block, columns[13 + flag], first, memory[places[10 + flag] : places[11 + flag]])
    source_type = integers[places[6] >> 2 : places[7] >> 2]
    start = block.columns[columns[16], FIRST] + first
    for row in range(len(source_type)):
        source_type[row] = words[start + row]
    copy_texts(block, plan, first, last, memory, places)
    return len(columns)


@device_function
def _clear(values: Array) -> None:
    for k in range(len(values)):
        values[k] = 0


@device_function
def _join_pairs(block: ColumnBlock, columns: Array, row: int, count: Any, points: Array, width: int) -> None:
    """Fill the first two of the ``width`` coordinates of points, (width * n,)."""
    first, second = element(block, columns[0], row), element(block, columns[1], row)
    numbers = as_float32(block.memory)
    _interleave(numbers[first : first + count], numbers[second : second + count], points, width)


@device_function(in_lanes=True)
def _interleave(x: Array, y: Array, points: Array, width: int) -> None:
    for k in range(len(x)):
        points[width * k] = x[k]
        points[width * k + 1] = y[k]


@device_function
def _fill_sizes(block: ColumnBlock, columns: Array, row: int, valid: Array, sizes: Array) -> None:
    """Fill extents, (3 * n,), at the valid timesteps of a span; a list of one element holds at all of them."""
    x, y, z = element(block, columns[0], row), element(block, columns[1], row), element(block, columns[2], row)
    numbers, integers = as_float32(block.memory), as_int32(block.memory)
    count_x = integers[block.columns[columns[0], LENGTHS] + row]
    count_y = integers[block.columns[columns[1], LENGTHS] + row]
    count_z = integers[block.columns[columns[2], LENGTHS] + row]
    steps = 1 if count_x > 1 else 0, 1 if count_y > 1 else 0, 1 if count_z > 1 else 0
    _join_sizes(numbers[x : x + count_x], numbers[y : y + count_y], numbers[z : z + count_z], steps, valid, sizes)


@device_function(in_lanes=True)
def _join_sizes(x: Array, y: Array, z: Array, steps: tuple[int, int, int], valid: Array, sizes: Array) -> None:
    """The same of lists, in which one takes ``steps`` from a timestep to the next."""
    by_x, by_y, by_z = steps
    for k in range(len(valid)):
        is_valid = valid[k] != 0
        sizes[3 * k] = x[by_x * k] if is_valid else _NONE
        sizes[3 * k + 1] = y[by_y * k] if is_valid else _NONE
        sizes[3 * k + 2] = z[by_z * k] if is_valid else _NONE


@device_function
def _fill_flags(block: ColumnBlock, column: int, row: int, default: bool, out: Array) -> None:
    """Fill the flags of a span, which are False: the listed ones, or ``default`` where there is no list."""
    start, count = element(block, column, row), as_int32(block.memory)[block.columns[column, LENGTHS] + row]
    if count:
        for k in range(count):
            out[k] = block.memory[start + k] != 0
    elif default:
        for k in range(len(out)):
            out[k] = True
