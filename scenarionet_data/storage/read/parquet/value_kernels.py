"""Compiled decoder of Parquet pages: all columns of a row group in one call.

Values are PLAIN, in BYTE_STREAM_SPLIT, or dictionary indices in the RLE/bit-packed hybrid,
https://parquet.apache.org/docs/file-format/data-pages/encodings/. Nothing is read or written out of bounds.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from scenarionet_data.arrays.columns import (
    BITS,
    FIRST,
    FIRST_BYTE,
    INDICES,
    KIND,
    LAST_BYTE,
    LENGTHS,
    LIST,
    OFFSETS,
    ROOM,
    SHAPE,
    SIZE,
    TEXTS,
    WORDS,
    ColumnBlock,
)
from scenarionet_data.arrays.dtypes import Array
from scenarionet_data.compiled.byte_views import as_int32, as_int64
from scenarionet_data.compiled.decorators import device_function
from scenarionet_data.storage.read.parquet.byte_kernels import byte_at, word_at
from scenarionet_data.storage.read.parquet.level_kernels import keep_levels, read_levels, repeat_levels
from scenarionet_data.storage.read.parquet.page_kernels import (
    BYTE_STREAM_SPLIT,
    COUNT,
    ENCODING,
    END,
    NUM_WORDS,
    START,
    VALUES,
)
from scenarionet_data.storage.read.parquet.text_kernels import copy_text
from scenarionet_data.storage.read.parquet.thrift_kernels import UNKNOWN, count_at

_NAN, _NO_WORD, _NO_BIT = 0x7FC00000, -1, np.uint8(255)
"""Values of rows that are null."""


@device_function
def decode_page(
    data: Array, levels: Array, pages: Array, column: int, row: int, num_rows: int, out: ColumnBlock
) -> bool:
    """Decode lengths, offsets and values of a column behind those before; returns whether its page is consistent.

    Args:
        data: (n,) uint8 decompressed pages, followed by SPARE bytes.
        levels: (4, m) uint8 levels of the last page of each shape, for columns that repeat them.
        pages: (C, NUM_PAGE_FIELDS) int64.
        column: The column.
        row: First row of the row group.
        num_rows: Its number of rows.
        out: Filled.
    """
    page, described, integers = pages[column], out.columns[column], as_int32(out.memory)
    shape, kind, done = described[SHAPE], described[KIND], described[SIZE]
    lengths = integers[described[LENGTHS] + row : described[LENGTHS] + row + num_rows]
    offsets = integers[described[OFFSETS] + row : described[OFFSETS] + row + num_rows + 1]
    other = column - 1 if shape else -1
    while other >= 0 and (out.columns[other, SHAPE] != shape or pages[other, VALUES] == 0):
        other -= 1
    if other >= 0 and repeat_levels(data, page, levels[shape], pages[other]):
        known = integers[out.columns[other, LENGTHS] + row :]
        for k in range(num_rows):
            lengths[k] = known[k]
    elif not read_levels(data, page, shape, lengths):
        return False
    elif shape:
        keep_levels(data, page, levels[shape])
    count, end = page[COUNT], done
    offsets[0] = done
    for k in range(num_rows):
        end += lengths[k]
        offsets[k + 1] = end
    places = count if shape & LIST else num_rows
    if end - done != count or places > described[ROOM] - done:
        return False
    first = described[FIRST] + done
    described[SIZE] = done + places
    is_consistent = _read_values(data, page, described, first, count, out.memory)
    if places > count:
        _spread(kind, lengths, first, count, out.memory)
    page[VALUES] -= page[START]  # the size of its levels
    return is_consistent


@device_function
def fill_nulls(column: int, row: int, num_rows: int, out: ColumnBlock) -> None:
    """Add rows to a column that a file lacks."""
    described, integers = out.columns[column], as_int32(out.memory)
    done, kind = described[SIZE], described[KIND]
    lengths = integers[described[LENGTHS] + row : described[LENGTHS] + row + num_rows]
    offsets = integers[described[OFFSETS] + row :]
    for k in range(num_rows):
        lengths[k] = 0
        offsets[k] = done
    offsets[num_rows] = done
    if not described[SHAPE] & LIST:
        first = described[FIRST] + done
        if kind == TEXTS:
            as_int64(out.memory)[first] = described[FIRST_BYTE]
        _spread(kind, lengths, first, 0, out.memory)
        described[SIZE] = done + num_rows


@device_function
def _spread(kind: int, lengths: Array, first: int, count: int, memory: Array) -> None:
    """Move the values of a column to their rows; the others are null."""
    words, ends = as_int32(memory), as_int64(memory)
    for row in range(len(lengths) - 1, -1, -1):  # in place, so from the last one
        if kind == TEXTS:
            ends[first + row + 1] = ends[first + count]
        count -= lengths[row]
        if kind == BITS:
            memory[first + row] = memory[first + count] if lengths[row] else _NO_BIT
        elif kind != TEXTS:
            null = _NAN if kind == WORDS else _NO_WORD
            words[first + row] = words[first + count] if lengths[row] else null


@device_function
def _read_values(data: Array, page: Array, column: Array, first: int, count: int, memory: Array) -> bool:
    """Decode the values of a page; returns whether it is consistent."""
    kind = column[KIND]
    if kind == WORDS:
        return _read_words(data, page, as_int32(memory)[first : first + count])
    if kind == BITS:
        return _read_bits(data, page, memory[first : first + count])
    if kind == INDICES:
        return _read_indices(data, page, as_int32(memory)[first : first + count])
    return _read_texts(data, page, column, as_int64(memory)[first : first + count + 1], memory)


@device_function
def _read_words(data: Array, page: Array, values: Array) -> bool:
    """Decode 4-byte values, PLAIN or in BYTE_STREAM_SPLIT; returns whether the page is consistent."""
    at, count = page[VALUES], len(values)
    if page[END] - at != 4 * count:
        return False
    if page[ENCODING] == BYTE_STREAM_SPLIT:
        _join(data[at:], count, values)
    else:
        for i in range(count):
            values[i] = word_at(data, at + 4 * i)
    return True


@device_function
def _join(streams: Array, count: int, values: Array) -> None:
    """Join 4-byte words from the streams of their first, second, third and fourth bytes."""
    first, second = streams[:count], streams[count : 2 * count]
    third, fourth = streams[2 * count : 3 * count], streams[3 * count : 4 * count]
    for i in range(count):
        low = np.uint32(first[i]) | np.uint32(second[i]) << np.uint32(8)
        values[i] = low | np.uint32(third[i]) << np.uint32(16) | np.uint32(fourth[i]) << np.uint32(24)


@device_function
def _read_bits(data: Array, page: Array, values: Array) -> bool:
    """Decode truth values; returns whether the page is consistent."""
    at, count = page[VALUES], len(values)
    if page[END] - at != (count + 7) >> 3:
        return False
    for i in range(count):
        values[i] = data[at + (i >> 3)] >> (i & 7) & 1
    return True


@device_function
def _read_indices(data: Array, page: Array, values: Array) -> bool:
    """Decode dictionary indices (bit width, then RLE/bit-packed hybrid); returns whether the page is consistent."""
    at, end, count = page[VALUES], page[END], len(values)
    if at >= end:
        return count == 0
    width = byte_at(data, at)
    at, done = at + 1, 0
    if width > 24:  # more words than any vocabulary
        return False
    while done < count and at < end:
        header, at = count_at(data, at)
        is_packed, length = header & 1, header >> 1
        stop = min(done + (length << 3 if is_packed else length), count)
        size = ((stop - done) * width if is_packed else width) + 7 >> 3
        if at + size > end:
            return False
        for place in range(stop - done):
            bit = place * width if is_packed else 0
            index = word_at(data, at + (bit >> 3)) >> (bit & 7) & ((1 << width) - 1)
            if index >= page[NUM_WORDS]:
                return False
            values[done + place] = index
        at += length * width if is_packed else size
        done = stop
    return bool(done == count)


@device_function
def _read_texts(data: Array, page: Array, column: Array, ends: Array, text: Array) -> bool:
    """Decode texts behind those before; returns whether the page is consistent, and the texts are UTF-8."""
    at, end, size, limit = page[VALUES], page[END], column[FIRST_BYTE], column[LAST_BYTE]
    ends[0] = size
    if end - at > limit - size:
        return False
    for i in range(len(ends) - 1):
        length = word_at(data, at) if at + 4 <= end else end
        at += 4
        if length > end - at or not copy_text(data, at, length, text, size, limit):
            return False
        at, size = at + length, size + length
        ends[i + 1] = size
    column[FIRST_BYTE] = size
    return bool(at == end)


@device_function
def count_words(data: Array) -> Any:
    """Number of words in a dictionary page; UNKNOWN if it is inconsistent."""
    at, count = 0, 0
    while at + 4 <= len(data):
        size = word_at(data, at)
        at, count = at + 4 + size, count + 1
    return count if at == len(data) else UNKNOWN
