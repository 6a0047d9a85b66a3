"""Compiled loops that copy the texts of a scenario out of those of a table."""

from __future__ import annotations

from typing import NamedTuple

from scenarionet_data.arrays.columns import ColumnBlock
from scenarionet_data.arrays.compiled import device_function, kernel
from scenarionet_data.arrays.dtypes import Array


class TextArrays(NamedTuple):
    """Texts in n columns of some rows, one column after the other.

    Attributes:
        columns: (n,) int64 the columns.
        are_lists: (C,) bool whether each column of the table holds lists.
        firsts: (n,) int64 place in ``ends`` of the start of each column.
        offsets: (n, M + 1) int32 number of texts before each row; a value that is null counts as none.
        ends: (n + number of texts,) int64 start of the first text of each column, and ends of all.
        text: uint8 UTF-8.
    """

    columns: Array
    are_lists: Array
    firsts: Array
    offsets: Array
    ends: Array
    text: Array


@kernel(nogil=True, allocates=False)
def measure_texts(block: ColumnBlock, columns: Array, are_lists: Array, first: int, last: int) -> tuple[int, int]:
    """Number of texts in some rows of some columns, and their bytes.

    Args:
        block: Rows.
        columns, are_lists: See ``TextArrays``.
        first, last: The rows.
    """
    count, size = 0, 0
    for place in range(len(columns)):
        begin, end = _texts(block, columns[place], are_lists[columns[place]], first, last)
        count += end - begin
        size += block.ends[end] - block.ends[begin]
    return count, size


@device_function
def copy_texts(block: ColumnBlock, first: int, out: TextArrays) -> None:
    """Copy texts from a row on; there must be room for what :func:`measure_texts` found."""
    at, size, last = 0, 0, first + out.offsets.shape[1] - 1
    for place in range(len(out.columns)):
        column, offsets = out.columns[place], out.offsets[place]
        begin, end = _texts(block, column, out.are_lists[column], first, last)
        out.firsts[place], offsets[0] = at, 0
        for row in range(last - first):
            offsets[row + 1] = offsets[row] + block.lists[0, column, first + row]
        start = block.ends[begin]
        for k in range(begin, end + 1):
            out.ends[at + k - begin] = block.ends[k] - start + size
        source = block.text[start : block.ends[end]]
        target = out.text[size : size + len(source)]
        for k in range(len(source)):
            target[k] = source[k]
        at, size = at + end - begin + 1, size + len(source)


@device_function
def _texts(block: ColumnBlock, column: int, is_list: bool, first: int, last: int) -> tuple[int, int]:
    """Places of the start of the first text of some rows, and of the end of the last one."""
    if is_list:
        return block.firsts[column] + block.lists[1, column, first], block.firsts[column] + block.lists[1, column, last]
    return block.firsts[column] + first, block.firsts[column] + last
