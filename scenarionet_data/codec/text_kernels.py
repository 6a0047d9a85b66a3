"""Compiled loops that copy the texts of a scenario out of those of a table."""

from __future__ import annotations

from scenarionet_data.arrays.byte_views import as_int32, as_int64
from scenarionet_data.arrays.columns import FIRST, LENGTHS, OFFSETS, ColumnBlock
from scenarionet_data.arrays.compiled import device_function, kernel
from scenarionet_data.arrays.dtypes import Array


@kernel(nogil=True, allocates=False)
def measure_texts(block: ColumnBlock, columns: Array, are_lists: Array, first: int, last: int) -> tuple[int, int]:
    """Number of texts in some rows of some columns, and their bytes.

    Args:
        block: Rows.
        columns: (n,) int64 the columns.
        are_lists: (C,) bool whether each column of the table holds lists.
        first, last: The rows.
    """
    count, size, ends = 0, 0, as_int64(block.memory)
    for place in range(len(columns)):
        begin, end = _texts(block, columns[place], are_lists[columns[place]], first, last)
        count += end - begin
        size += ends[end] - ends[begin]
    return count, size


@kernel(nogil=True, allocates=False)
def copy_texts(
    block: ColumnBlock,
    columns: Array,
    are_lists: Array,
    first: int,
    last: int,
    memory: Array,
    places: tuple[int, int, int],
) -> None:
    """Copy the texts of some rows, one column after the other; see :func:`measure_texts`.

    Args:
        block: Rows.
        columns, are_lists, first, last: As in :func:`measure_texts`.
        memory: uint8 memory of three arrays, which are filled: (n + number of texts,) int64 start of the first text of
            each column, and ends of all; (n * (M + 1),) int32 number of texts before each row, where a value that is
            null counts as none; and UTF-8.
        places: Start of each of these.
    """
    ends, offsets = as_int64(memory)[places[0] >> 3 :], as_int32(memory)[places[1] >> 2 :]
    text = memory[places[2] :]
    known, lists, at, size, row_at = as_int64(block.memory), as_int32(block.memory), 0, 0, 0
    for place in range(len(columns)):
        column = columns[place]
        begin, end = _texts(block, column, are_lists[column], first, last)
        lengths = lists[block.columns[column, LENGTHS] :]
        offsets[row_at] = 0
        for row in range(first, last):
            offsets[row_at + 1] = offsets[row_at] + lengths[row]
            row_at += 1
        row_at += 1
        start = known[begin]
        for k in range(begin, end + 1):
            ends[at + k - begin] = known[k] - start + size
        source = block.memory[start : known[end]]
        target = text[size : size + len(source)]
        for k in range(len(source)):
            target[k] = source[k]
        at, size = at + end - begin + 1, size + len(source)


@device_function
def _texts(block: ColumnBlock, column: int, is_list: bool, first: int, last: int) -> tuple[int, int]:
    """Places of the start of the first text of some rows, and of the end of the last one."""
    start = block.columns[column, FIRST]
    if is_list:
        offsets = as_int32(block.memory)[block.columns[column, OFFSETS] :]
        return start + offsets[first], start + offsets[last]
    return start + first, start + last
