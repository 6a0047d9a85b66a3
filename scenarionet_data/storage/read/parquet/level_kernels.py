"""Compiled decoder of the levels of Parquet pages: how many values each row has.

Definition and repetition levels are in the RLE/bit-packed hybrid,
https://parquet.apache.org/docs/file-format/data-pages/encodings/. Nothing is read or written out of bounds.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from scenarionet_data.arrays.columns import LIST, NULLABLE
from scenarionet_data.arrays.dtypes import Array
from scenarionet_data.compiled.decorators import device_function
from scenarionet_data.storage.read.parquet.byte_kernels import double_at, trailing_zeros, word_at
from scenarionet_data.storage.read.parquet.page_kernels import (
    COUNT,
    END,
    LEVELS,
    START,
    VALUES,
)
from scenarionet_data.storage.read.parquet.thrift_kernels import UNKNOWN, count_at

_ONE = np.uint64(1)


@device_function
def read_levels(data: Array, page: Array, shape: int, lengths: Array) -> bool:
    """Decode the lengths of a page's rows, and locate its values.

    Args:
        data: (n,) uint8 decompressed pages, followed by SPARE bytes.
        page: (NUM_PAGE_FIELDS,) int64; fills VALUES and COUNT.
        shape: LIST or 0, plus NULLABLE.
        lengths: (rows,) int32, filled.

    Returns:
        Whether the page has as many rows, and is consistent.
    """
    at, end, num_levels = page[START], page[END], page[LEVELS]
    rows, empty = num_levels, 0
    if not shape & LIST:
        if rows != len(lengths):
            return False
        for row in range(rows):
            lengths[row] = 1
    else:
        stop = _levels_end(data, at, end)
        if stop == UNKNOWN or _count_levels(data, at + 4, stop, num_levels, lengths) != len(lengths):
            return False
        at = stop
    if shape:
        stop = _levels_end(data, at, end)
        deepest = 2 if shape == NULLABLE | LIST else 1
        empty = UNKNOWN if stop == UNKNOWN else _mark_empty(data, at + 4, stop, num_levels, deepest, lengths)
        at = stop
    page[VALUES], page[COUNT] = at, num_levels - empty
    return bool(empty != UNKNOWN)


@device_function
def repeat_levels(data: Array, page: Array, levels: Array, known: Array) -> bool:
    """Locate the values of a page if it has the same levels as an earlier one, as the coordinates of points have.

    Args:
        data: (n,) uint8 decompressed pages.
        page: (NUM_PAGE_FIELDS,) int64; fills VALUES and COUNT.
        levels: uint8 levels of the earlier page.
        known: The earlier page, whose VALUES is the size of its levels.
    """
    size, differences = known[VALUES], np.uint8(0)
    if page[LEVELS] != known[LEVELS] or size > page[END] - page[START]:
        return False
    found = data[page[START] : page[START] + size]
    for k in range(len(found)):
        differences |= found[k] ^ levels[k]
    if differences:
        return False
    page[VALUES], page[COUNT] = page[START] + size, known[COUNT]
    return True


@device_function
def keep_levels(data: Array, page: Array, levels: Array) -> None:
    """Copy the levels of a page to ``levels``, at least as large as the page, for :func:`repeat_levels`."""
    found = data[page[START] : page[VALUES]]
    for k in range(len(found)):
        levels[k] = found[k]


@device_function
def _levels_end(data: Array, at: int, end: int) -> int:
    """End of levels that are preceded by their size."""
    if end - at < 4:
        return UNKNOWN
    stop = at + 4 + word_at(data, at)
    return stop if stop <= end else UNKNOWN


@device_function
def _count_levels(data: Array, at: int, end: int, num_levels: int, lengths: Array) -> int:
    """Count the levels of each list from repetition levels (0 at its first element); returns the number of lists."""
    done, rows, begin = 0, 0, 0
    while done < num_levels and at < end:
        header, at = count_at(data, at)
        is_packed, length = header & 1, header >> 1
        stop = min(done + (length << 3 if is_packed else length), num_levels)
        size = (stop - done + 7) >> 3 if is_packed else 1
        if at + size > end or (done == 0 and size and data[at] & 1):  # the first level must begin a list
            return UNKNOWN
        if not is_packed:
            if data[at] & 1 == 0:  # lists of one element
                if stop - done > len(lengths) - rows:
                    return UNKNOWN
                for level in range(done, stop):
                    lengths[max(rows - 1, 0)] = level - begin
                    rows, begin = rows + 1, level
        else:
            for place in range(done, stop, 56):
                begins = _first_bits(data, at + ((place - done) >> 3), min(stop - place, 56))
                while begins:
                    if rows == len(lengths):
                        return UNKNOWN
                    level = place + trailing_zeros(begins)
                    lengths[max(rows - 1, 0)] = level - begin
                    rows, begin = rows + 1, level
                    begins &= begins - _ONE
        at += length if is_packed else 1
        done = stop
    if done < num_levels or rows == 0:
        return UNKNOWN
    lengths[rows - 1] = num_levels - begin
    return rows


@device_function
def _first_bits(data: Array, at: int, count: int) -> Any:
    """Up to 56 bits from a byte on, inverted: a bit is set where a list begins."""
    bits = np.uint64(0)
    if at + 8 <= len(data):
        bits = double_at(data, at)
    else:
        for k in range((count + 7) >> 3):
            bits |= np.uint64(data[at + k]) << np.uint64(8 * k)
    return ~bits & ((_ONE << np.uint64(count)) - _ONE)


@device_function
def _mark_empty(data: Array, at: int, end: int, num_levels: int, deepest: int, lengths: Array) -> int:
    """Set lengths of rows without values to 0 (their only definition level is below ``deepest``); returns their number.

    A level has 1 bit, or 2 bits when ``deepest`` is 2; levels never cross a byte.
    """
    width, mask = deepest, (1 << deepest) - 1
    shift, full = (3, 255) if deepest == 1 else (2, 0b10101010)  # levels in a byte, as a power of two
    done, empty, row, next_begin = 0, 0, -1, 0
    while done < num_levels and at < end:
        header, at = count_at(data, at)
        is_packed = header & 1
        stop = min(done + (header >> 1) * (8 if is_packed else 1), num_levels)
        if at + (((stop - done) * width + 7) >> 3 if is_packed else 1) > end:
            return UNKNOWN
        if not is_packed and data[at] == deepest:
            done, at = stop, at + 1
            continue
        for first in range(done, stop, 1 << shift):
            bits = data[at + ((first - done) >> shift)] if is_packed else data[at]
            if is_packed and bits == full:
                continue
            for place in range(first, min(first + (1 << shift), stop)):
                if is_packed and bits >> ((place - first) * width) & mask == deepest:
                    continue
                while next_begin <= place:
                    row += 1
                    next_begin += lengths[row]
                lengths[row] = 0
                empty += 1
        at += (header >> 1) * width if is_packed else 1
        done = stop
    return empty if done == num_levels else UNKNOWN
