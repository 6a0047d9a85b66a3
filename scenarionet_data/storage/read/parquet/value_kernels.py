"""Compiled decoder of Parquet pages: all columns of a row group in one call.

Values are PLAIN, in BYTE_STREAM_SPLIT, or dictionary indices in the RLE/bit-packed hybrid,
https://parquet.apache.org/docs/file-format/data-pages/encodings/. Nothing is read or written out of bounds.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from scenarionet_data.arrays.compiled import device_function, kernel
from scenarionet_data.arrays.dtypes import Array
from scenarionet_data.storage.read.parquet.byte_kernels import byte_at
from scenarionet_data.storage.read.parquet.level_kernels import read_levels, repeat_levels
from scenarionet_data.storage.read.parquet.page_kernels import (
    BYTE_STREAM_SPLIT,
    CHUNK_ROOM,
    CHUNK_SIZE,
    COUNT,
    ENCODING,
    END,
    NUM_WORDS,
    START,
    VALUES,
    uint32_at,
)
from scenarionet_data.storage.read.parquet.thrift_kernels import UNKNOWN, count_at

# Columns of an array of columns: LIST and NULLABLE, kind of the values, place of the first one, and how many there is
# room for.
NUM_COLUMN_FIELDS = 4
SHAPE, KIND, FIRST, ROOM = range(NUM_COLUMN_FIELDS)
WORDS, BITS, INDICES, TEXTS = range(4)


class Decoded(NamedTuple):
    """Memory for the values of some row groups; C columns, R rows."""

    lists: Array  # (2, C, R + 1) int32 length of each row's list, or 1 for a value and 0 for null; and offsets
    counts: Array  # (C,) int64 number of values; UNKNOWN for a column with a page that is
    words: Array  # uint32 numbers, and indices in the dictionary of the page
    bits: Array  # int8 truth values
    ends: Array  # int64 ends of the texts of all columns, by row group; the first is 0
    text: Array  # uint8 these texts
    num_texts: Array  # (1,) int64


@kernel(nogil=True, allocates=False)
def reserve(chunks: Array, columns: Array) -> tuple[int, int, int, int]:
    """Reserve places for values.

    Args:
        chunks: (C, NUM_CHUNK_FIELDS) int64 sum over the row groups.
        columns: (C, NUM_COLUMN_FIELDS) int64; fills FIRST and ROOM.

    Returns:
        Number of words, bits, texts, and bytes of texts.
    """
    words, bits, texts, size = 0, 0, 0, 0
    for column in range(len(columns)):
        kind, count = columns[column, KIND], chunks[column, CHUNK_ROOM]
        columns[column, ROOM] = count
        if kind == TEXTS:
            texts += count
            size += chunks[column, CHUNK_SIZE] if count else 0
        elif kind == BITS:
            columns[column, FIRST] = bits
            bits += count
        else:
            columns[column, FIRST] = words
            words += count
    return words, bits, texts, size


@kernel(nogil=True, allocates=False)
def decode_pages(data: Array, pages: Array, columns: Array, row: int, num_rows: int, out: Decoded) -> int:
    """Decode the pages of a row group behind the values of those before.

    Args:
        data: (n,) uint8 decompressed pages, followed by SPARE bytes.
        pages: (C, NUM_PAGE_FIELDS) int64.
        columns: (C, NUM_COLUMN_FIELDS) int64.
        row: First row of the row group.
        num_rows: Its number of rows.
        out: Filled.

    Returns:
        The first column that is damaged; -1 for none.
    """
    for column in range(len(pages)):
        if out.counts[column] == UNKNOWN or pages[column, START] < 0:
            out.counts[column] = UNKNOWN
        elif not _decode_page(data, pages, columns, column, row, num_rows, out):
            return column
    return -1


@device_function
def _decode_page(data: Array, pages: Array, columns: Array, column: int, row: int, num_rows: int, out: Decoded) -> bool:
    """Decode lengths, offsets and values of a column; returns whether its page is consistent."""
    page, shape, kind = pages[column], columns[column, SHAPE], columns[column, KIND]
    lengths, offsets = out.lists[0, column, row : row + num_rows], out.lists[1, column]
    other = column - 1
    while other >= 0 and (columns[other, SHAPE] != shape or out.counts[other] == UNKNOWN):
        other -= 1
    if other >= 0 and repeat_levels(data, pages[other], page):
        for k in range(num_rows):
            lengths[k] = out.lists[0, other, row + k]
    elif not read_levels(data, page, shape, lengths):
        return False
    done, count = out.counts[column], page[COUNT]
    offsets[row] = done
    for k in range(num_rows):
        offsets[row + k + 1] = offsets[row + k] + lengths[k]
    if offsets[row + num_rows] - done != count or count > columns[column, ROOM] - done:
        return False
    out.counts[column] = done + count
    first = columns[column, FIRST] + done
    if kind == WORDS:
        return _read_words(data, page, out.words[first : first + count])
    if kind == BITS:
        return _read_bits(data, page, out.bits[first : first + count])
    if kind == INDICES:
        return _read_indices(data, page, out.words[first : first + count])
    return _read_texts(data, page, out)


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
            values[i] = uint32_at(data, at + 4 * i)
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
            index = uint32_at(data, at + (bit >> 3)) >> (bit & 7) & ((1 << width) - 1)
            if index >= page[NUM_WORDS]:
                return False
            values[done + place] = index
        at += length * width if is_packed else size
        done = stop
    return bool(done == count)


@device_function
def _read_texts(data: Array, page: Array, out: Decoded) -> bool:
    """Decode texts behind those before; returns whether the page is consistent."""
    at, end, first = page[VALUES], page[END], out.num_texts[0]
    size = out.ends[first]
    if page[COUNT] >= len(out.ends) - first or end - at > len(out.text) - size:
        return False
    for i in range(page[COUNT]):
        length = uint32_at(data, at) if at + 4 <= end else end
        at += 4
        if length > end - at:
            return False
        for k in range(length):
            out.text[size + k] = data[at + k]
        at, size = at + length, size + length
        out.ends[first + i + 1] = size
    out.num_texts[0] = first + page[COUNT]
    return bool(at == end)
