"""Compiled loops that place the arrays of a part of a scenario in memory, and copy its texts there."""

from __future__ import annotations

from typing import Any, NamedTuple

from scenarionet_data.arrays.columns import FIRST, LENGTHS, OFFSETS, ColumnBlock
from scenarionet_data.arrays.dtypes import Array, Bool, Int64
from scenarionet_data.codec.copy_kernels import copy
from scenarionet_data.compiled.byte_views import as_int32, as_int64
from scenarionet_data.compiled.decorators import device_function, kernel

ROWS, ENDS = -1, -2
"""Lengths of arrays: one element for each row of the part, or one more."""
_BYTES, _LENGTH, _IS_OVER_TIME = range(3)


class PartPlan(NamedTuple):
    """Arrays of a part.

    Attributes:
        columns: int64 columns that the part's kernel reads, in the order of ``StoredPart.columns``.
        texts: (n,) int64 columns of texts.
        are_lists: (n,) bool whether each of them holds lists.
        arrays: (A, 3) int64 for each other array the bytes of an element; its length: ROWS, ENDS, or the column whose
            elements it has; and whether it has as many elements for each timestep.
    """

    columns: Int64
    texts: Int64
    are_lists: Bool
    arrays: Int64


@kernel(nogil=True, allocates=False)
def lay_out(block: ColumnBlock, plan: PartPlan, first: int, last: int, steps: int, places: Array) -> Any:
    """Place the arrays of a part one after the other: ends of texts, numbers of texts, others, texts.

    Args:
        block: Rows.
        plan: The arrays.
        first, last: Rows of the part.
        steps: Number of timesteps.
        places: (A + 4,) int64, filled with the start of each array [bytes], and the end of the last one.

    Returns:
        Bytes of memory, a multiple of 8 for kernels, which see it as an array of each width.
    """
    integers, ends = as_int32(block.memory), as_int64(block.memory)
    num_columns, count, size = len(plan.texts), 0, 0
    for place in range(num_columns):
        begin, end = _texts(block, plan.texts[place], plan.are_lists[place], first, last)
        count += end - begin
        size += ends[end] - ends[begin]
    places[0], places[1] = 0, 8 * (count + num_columns)
    at = places[1] + 4 * num_columns * (last - first + 1)
    for place in range(len(plan.arrays)):
        places[2 + place] = at
        length = plan.arrays[place, _LENGTH]
        if length < 0:
            elements = last - first + (length == ENDS)
        else:
            offsets = integers[block.columns[length, OFFSETS] :]
            elements = offsets[last] - offsets[first]
        at += plan.arrays[place, _BYTES] * elements * (steps if plan.arrays[place, _IS_OVER_TIME] else 1)
    places[len(places) - 2], places[len(places) - 1] = at, at + size
    return at + size + 7 >> 3 << 3


@device_function
def copy_texts(block: ColumnBlock, plan: PartPlan, first: int, last: int, memory: Array, places: Array) -> None:
    """Copy the texts of some rows, one column after the other.

    Args:
        block: Rows.
        plan: The columns.
        first, last: The rows.
        memory: uint8 memory of three arrays, which are filled: (n + number of texts,) int64 start of the first text of
            each column, and ends of all; (n * (M + 1),) int32 number of texts before each row, where a value that is
            null counts as none; and UTF-8.
        places: Those of all arrays, see :func:`lay_out`.
    """
    ends, offsets, text = as_int64(memory), as_int32(memory)[places[1] >> 2 :], memory[places[len(places) - 2] :]
    known, integers = as_int64(block.memory), as_int32(block.memory)
    at, size, row_at = 0, 0, 0
    for place in range(len(plan.texts)):
        column = plan.texts[place]
        begin, end = _texts(block, column, plan.are_lists[place], first, last)
        lengths = integers[block.columns[column, LENGTHS] :]
        offsets[row_at] = 0
        for row in range(first, last):
            offsets[row_at + 1] = offsets[row_at] + lengths[row]
            row_at += 1
        row_at += 1
        start = known[begin]
        for k in range(begin, end + 1):
            ends[at + k - begin] = known[k] - start + size
        source = block.memory[start : known[end]]
        copy(source, text[size : size + len(source)])
        at, size = at + end - begin + 1, size + len(source)


@device_function
def _texts(block: ColumnBlock, column: int, is_list: bool, first: int, last: int) -> tuple[int, int]:
    """Places of the start of the first text of some rows, and of the end of the last one."""
    start = block.columns[column, FIRST]
    if is_list:
        offsets = as_int32(block.memory)[block.columns[column, OFFSETS] :]
        return start + offsets[first], start + offsets[last]
    return start + first, start + last
