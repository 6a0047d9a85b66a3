"""Parquet pages of float lists, decoded by compiled code; and the end of a Thrift struct, found by it.

Format: https://parquet.apache.org/docs/file-format/ (data page version 1; levels in the RLE/bit-packed hybrid;
values in BYTE_STREAM_SPLIT) and Thrift's compact protocol for the page header.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt
from numba import njit

Array = npt.NDArray[Any]

UNKNOWN = -1
"""A header that is not what our writer makes."""

_STOP, _BINARY, _STRUCT = 0, 8, 12
_VARINTS = (4, 5, 6)
_DATA_PAGE_HEADER = 5


@njit(cache=True)
def read_header(data: Array, at: int) -> tuple[int, int, int, int, int, int]:
    """A page's header: where the page begins, its compressed and uncompressed size, type, values and encoding.

    Args:
        data: (n,) uint8 the file.
        at: Where the header begins.

    Returns:
        All UNKNOWN when the header holds what no data page of version 1 does.
    """
    sizes = np.full(3, UNKNOWN, np.int64)  # page type, uncompressed, compressed: fields 1 to 3
    inner = np.full(2, UNKNOWN, np.int64)  # values, encoding: fields 1 and 2 of the data page header
    depth, field, parent = 0, 0, 0
    fields = np.zeros(8, np.int64)
    while at < len(data):
        byte = data[at]
        at += 1
        kind, step = byte & 15, byte >> 4
        if kind == _STOP:
            if depth == 0:
                return at, sizes[2], sizes[1], sizes[0], inner[0], inner[1]
            depth -= 1
            field = fields[depth]
            continue
        if step:
            field += step
        else:
            field, at = _zigzag(data, at)
        if kind in _VARINTS:
            value, at = _zigzag(data, at)
            if depth == 0 and field <= 3:
                sizes[field - 1] = value
            elif depth == 1 and parent == _DATA_PAGE_HEADER and field <= 2:
                inner[field - 1] = value
        elif kind == _BINARY:
            length, at = _varint(data, at)
            at += length
        elif kind == _STRUCT and depth < 7:
            fields[depth] = field
            if depth == 0:
                parent = field
            depth, field = depth + 1, 0
        elif kind > 2:  # 1 and 2 are true and false, without a value
            break
    return UNKNOWN, UNKNOWN, UNKNOWN, UNKNOWN, UNKNOWN, UNKNOWN


@njit(cache=True)
def read_lists(page: Array, num_levels: int, is_nullable: bool, lengths: Array, values: Array) -> tuple[int, int]:
    """Lists of floats of a column's only page, uncompressed.

    Args:
        page: (n,) uint8.
        num_levels: Levels in the page: elements, and one for each list without any.
        is_nullable: Whether a list may be null, which is read as an empty one.
        lengths: (num_levels,) int32, filled with the lists' lengths.
        values: (num_levels,) float32, filled with their elements.

    Returns:
        Numbers of lists and of elements; UNKNOWN when the page's parts do not add up.
    """
    size = len(page)
    second = 4 + _uint32(page, 0) if size >= 4 else size
    start = second + 4 + _uint32(page, second) if second + 4 <= size else size + 1
    if start > size:
        return UNKNOWN, UNKNOWN
    rows = _count_levels(page, 4, second, num_levels, lengths)
    if rows == UNKNOWN:
        return UNKNOWN, UNKNOWN
    empty = _mark_empty(page, second + 4, start, num_levels, 2 if is_nullable else 1, lengths)
    count = num_levels - empty
    if empty == UNKNOWN or size - start != 4 * count:
        return UNKNOWN, UNKNOWN
    _join(page[start:], count, values)
    return rows, count


@njit(cache=True)
def _join(streams: Array, count: int, values: Array) -> None:
    """Floats from their first, second, third and fourth bytes, one stream after the other."""
    words = values.view(np.uint32)[:count]
    first, second = streams[:count], streams[count : 2 * count]
    third, fourth = streams[2 * count : 3 * count], streams[3 * count : 4 * count]
    for i in range(count):
        low = np.uint32(first[i]) | np.uint32(second[i]) << np.uint32(8)
        words[i] = low | np.uint32(third[i]) << np.uint32(16) | np.uint32(fourth[i]) << np.uint32(24)


@njit(cache=True)
def _count_levels(page: Array, at: int, end: int, num_levels: int, lengths: Array) -> int:
    """Levels of each list, from repetition levels: 0 where a list begins, else 1; returns the number of lists."""
    done, rows = 0, 0
    while done < num_levels and at < end:
        header, at = _varint(page, at)
        is_packed = header & 1
        stop = min(done + (header >> 1) * (8 if is_packed else 1), num_levels)
        if at + ((stop - done + 7) // 8 if is_packed else 1) > end:
            return UNKNOWN
        for place in range(stop - done if is_packed else 0):
            if page[at + (place >> 3)] >> (place & 7) & 1 == 0:
                lengths[rows] = 0
                rows += 1
            if rows == 0:
                return UNKNOWN
            lengths[rows - 1] += 1
        if not is_packed and page[at] == 0:
            lengths[rows : rows + stop - done] = 1
            rows += stop - done
        elif not is_packed and rows > 0:
            lengths[rows - 1] += stop - done
        at += header >> 1 if is_packed else 1
        done = stop
    return rows if done == num_levels and rows > 0 else UNKNOWN


@njit(cache=True)
def _mark_empty(page: Array, at: int, end: int, num_levels: int, deepest: int, lengths: Array) -> int:
    """Set lengths of lists without elements to 0: their one definition level is not the deepest; returns their number.

    Levels have 1 bit each, or 2 where ``deepest`` is 2; both never cross a byte.
    """
    width, mask = deepest, (1 << deepest) - 1
    done, empty, row, next_begin = 0, 0, -1, 0
    while done < num_levels and at < end:
        header, at = _varint(page, at)
        is_packed = header & 1
        stop = min(done + (header >> 1) * (8 if is_packed else 1), num_levels)
        if at + (((stop - done) * width + 7) // 8 if is_packed else 1) > end:
            return UNKNOWN
        for place in range(done, stop if is_packed or page[at] != deepest else done):
            bit = (place - done) * width
            if is_packed and page[at + (bit >> 3)] >> (bit & 7) & mask == deepest:
                continue
            while next_begin <= place:
                row += 1
                next_begin += lengths[row]
            lengths[row] = 0
            empty += 1
        at += (header >> 1) * width if is_packed else 1
        done = stop
    return empty if done == num_levels else UNKNOWN


@njit(cache=True)
def _varint(data: Array, at: int) -> tuple[int, int]:
    value, shift = 0, 0
    while at < len(data) and shift < 70:  # ten bytes hold 64 bits
        byte = int(data[at])
        at += 1
        value |= (byte & 127) << shift
        shift += 7
        if byte < 128:
            break
    return value, at


@njit(cache=True)
def _zigzag(data: Array, at: int) -> tuple[int, int]:
    value, at = _varint(data, at)
    return (value >> 1) ^ -(value & 1), at


@njit(cache=True)
def _uint32(data: Array, at: int) -> int:
    return int(data[at]) | int(data[at + 1]) << 8 | int(data[at + 2]) << 16 | int(data[at + 3]) << 24


@njit(cache=True)
def struct_end(data: Array, at: int) -> int:
    """Where a struct of Thrift's compact protocol ends: nothing in it is kept.

    Args:
        data: (n,) uint8.
        at: Where it begins.

    Returns:
        UNKNOWN when it goes on after the data, holds maps, or is nested deeper than Parquet's footers are.
    """
    kinds = np.zeros(16, np.int64)  # of the elements of the list at each depth
    left = np.zeros(16, np.int64)  # elements to come of the list at each depth; -1 for a struct
    left[0] = -1
    depth = 0
    while depth >= 0 and at < len(data):
        if left[depth] == 0:
            depth -= 1
            continue
        if left[depth] > 0:
            left[depth] -= 1
            kind = kinds[depth]
            if kind <= 2:  # a truth value: a byte in a list, part of the head in a struct
                kind = 3
        else:
            head = data[at]
            at += 1
            kind = np.int64(head & 15)
            if kind == _STOP:
                depth -= 1
                continue
            if head >> 4 == 0:
                _, at = _varint(data, at)
        if kind == 3:
            at += 1
        elif kind in _VARINTS:
            _, at = _varint(data, at)
        elif kind == 7:
            at += 8
        elif kind == _BINARY:
            length, at = _varint(data, at)
            at += length
        elif kind == 9 and depth < 15:
            head = data[at]
            at += 1
            depth += 1
            kinds[depth], left[depth] = head & 15, head >> 4
            if head >> 4 == 15:
                left[depth], at = _varint(data, at)
        elif kind == _STRUCT and depth < 15:
            depth += 1
            left[depth] = -1
        elif kind > 2:
            return UNKNOWN
    return at if depth < 0 else UNKNOWN
