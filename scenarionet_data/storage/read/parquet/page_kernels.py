"""Parquet pages decoded by compiled code: a column of many row groups in one call.

Format: https://parquet.apache.org/docs/file-format/ (data pages of version 1; levels and dictionary indices in the
RLE/bit-packed hybrid; values PLAIN or in BYTE_STREAM_SPLIT) and LZ4 blocks,
https://github.com/lz4/lz4/blob/dev/doc/lz4_Block_format.md. Damaged bytes end in ``UNKNOWN``, nothing is read or
written out of bounds.

They run without Python's lock, so that threads decode side by side.

A column's values are told by ``lengths``, one for each row: of its list, or 1 and 0 for a value and a null.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numba import njit

from scenarionet_data.arrays.dtypes import Array
from scenarionet_data.storage.read.parquet.thrift_kernels import (
    DATA_PAGE,
    DICTIONARY_PAGE,
    UNKNOWN,
    count_at,
    read_header,
)

DAMAGED = -2

# Columns of an array of chunks: where one begins in its file, where its data page does and where it ends, its levels,
# its codec, its size when inflated, and the encodings that are known for it, a bit each.
CHUNK_START, _DATA, CHUNK_END, _LEVELS, _CODEC, CHUNK_SIZE, _KNOWN = range(7)
OTHER_CODEC, LZ4, ZSTD = 0, 1, 2

# Columns of an array of pages: where one begins (or UNKNOWN, DAMAGED) and ends, its levels and encoding, where its
# dictionary begins and ends and how many words it holds, where what is not inflated yet is in the file, and where its
# values begin and how many they are.
NUM_PAGE_FIELDS = 11
START, END, LEVELS, ENCODING, WORDS_START, WORDS_END, NUM_WORDS = range(7)
STORED, STORED_END, VALUES, COUNT = range(7, NUM_PAGE_FIELDS)
PLAIN, BYTE_STREAM_SPLIT, INDICES = 0, 9, 8

SPARE = 4
"""Bytes after the pages: what is read a word at a time may begin with a page's last byte."""

# Shapes of a column.
NULLABLE, LIST = 1, 2


@njit(cache=True, nogil=True)
def stage(data: Array, base: int, chunks: Array, pages: Array, number: int, scratch: Array, at: int) -> int:
    """Find a row group's pages and inflate those in LZ4; those in zstd get their place.

    Args:
        data: (n,) uint8 bytes of the file, from ``base`` on.
        chunks: (C, 7) int64, see there.
        pages: (C, k, NUM_PAGE_FIELDS) int64, 0, filled at the row group's ``number``; UNKNOWN for a column of more than
            one page, or of another kind.
        number: Which of the k row groups it is.
        scratch: (m,) uint8, filled from ``at`` on; it has room for the chunks' sizes.

    Returns:
        Where the next row group's pages begin.
    """
    for column in range(len(chunks)):
        limit = min(at + chunks[column, CHUNK_SIZE], len(scratch))
        page = pages[column, number]
        page[START] = _stage(data, base, chunks[column], page, scratch, at, limit)
        at = limit
    return at


@njit(inline="always")
def _stage(data: Array, base: int, chunk: Array, page: Array, scratch: Array, at: int, limit: int) -> int:
    """One column's page: where it begins in ``scratch``, between ``at`` and ``limit``."""
    first, middle, end = chunk[CHUNK_START] - base, chunk[_DATA] - base, chunk[CHUNK_END] - base
    codec = chunk[_CODEC]
    if not 0 <= first <= middle <= end <= len(data) or codec == OTHER_CODEC:
        return UNKNOWN
    if first < middle:  # a dictionary, up to the data page
        kind, size, stored_size, count, _ = read_header(data, first)
        if kind != DICTIONARY_PAGE or codec != LZ4 or stored_size > middle - first or size > limit - at:
            return UNKNOWN
        if not _inflate(data, middle - stored_size, middle, scratch, at, at + size):
            return DAMAGED
        page[WORDS_START], page[WORDS_END], page[NUM_WORDS] = at, at + size, count
        at += size
    kind, size, stored_size, count, encoding = read_header(data, middle)
    is_known = kind == DATA_PAGE and count == chunk[_LEVELS] and encoding < 16 and chunk[_KNOWN] >> encoding & 1
    if not is_known or stored_size > end - middle or size > limit - at:  # a page of several does not hold all levels
        return UNKNOWN
    page[END], page[LEVELS], page[ENCODING] = at + size, count, encoding
    if codec == ZSTD:
        page[STORED], page[STORED_END] = end - stored_size, end
    elif not _inflate(data, end - stored_size, end, scratch, at, at + size):
        return DAMAGED
    return at


@njit(nogil=True)
def _inflate(data: Array, at: int, end: int, target: Array, first: int, stop: int) -> bool:
    """Inflate an LZ4 block into ``target[first:stop]``; returns whether it fills just that."""
    to = first
    while at < end:
        token = _byte(data, at)
        length, at = _extended(data, at + 1, end, token >> 4)
        if length > end - at or length > stop - to:
            return False
        for k in range(length):
            target[to + k] = data[at + k]
        at, to = at + length, to + length
        if at == end:  # the last sequence has no match
            return to == stop
        if end - at < 2:
            return False
        distance = _byte(data, at) | _byte(data, at + 1) << 8
        length, at = _extended(data, at + 2, end, token & 15)
        length += 4
        if distance == 0 or distance > to - first or length > stop - to:
            return False
        for k in range(length):  # may read what it has just written
            target[to + k] = target[to + k - distance]
        to += length
    return False


@njit(inline="always")
def _extended(data: Array, at: int, end: int, nibble: int) -> tuple[int, int]:
    """A length that goes on in further bytes when its four bits are full."""
    length = nibble
    if length == 15:
        while at < end:
            byte = _byte(data, at)
            at += 1
            length += byte
            if byte != 255:
                break
    return length, at


@njit(cache=True, nogil=True)
def read_levels(data: Array, pages: Array, shapes: Array, firsts: Array, lists: Array, rows: Array) -> None:
    """Lengths of all columns' rows, and where the values of their pages are.

    Args:
        data: (n,) uint8 inflated pages, and SPARE bytes.
        pages: (C, k, NUM_PAGE_FIELDS) int64 of C columns and k row groups; VALUES and COUNT are filled.
        shapes: (C,) int64 LIST or 0, plus NULLABLE where a row may be null.
        firsts: (C,) int64 where each column begins in ``lists``.
        lists: (2, C + sum of levels) int32, filled: rows' lengths, and the offsets of their values.
        rows: (C,) int64 numbers of rows, filled; UNKNOWN when the parts of a page do not add up.
    """
    lengths, offsets = lists[0], lists[1]
    for column in range(len(pages)):
        first, done = firsts[column], 0
        for number in range(pages.shape[1]):
            page = pages[column, number]
            if page[START] < 0:
                done = UNKNOWN
                break
            found, count, at = _read_levels(data, page, shapes[column], lengths[first + done :])
            page[COUNT], page[VALUES] = count, at
            if found == UNKNOWN:
                done = UNKNOWN
                break
            done += found
        rows[column], offsets[first] = done, 0
        for row in range(first, first + done):
            offsets[row + 1] = offsets[row] + lengths[row]


@njit(cache=True, nogil=True)
def read_words(data: Array, pages: Array, values: Array) -> bool:
    """Values of 4 bytes, PLAIN or in BYTE_STREAM_SPLIT.

    Args:
        data: (n,) uint8 inflated pages, and SPARE bytes.
        pages: (k, NUM_PAGE_FIELDS) int64 the column's, row group by row group.
        values: (sum of COUNT,) uint32, filled.

    Returns:
        Whether the parts of all pages add up.
    """
    done = 0
    for page in pages:
        at, count = page[VALUES], page[COUNT]
        if page[END] - at != 4 * count:
            return False
        if page[ENCODING] == BYTE_STREAM_SPLIT:
            _join(data[at:], count, values[done:])
        else:
            for i in range(count):
                values[done + i] = _uint32(data, at + 4 * i)
        done += count
    return True


@njit(cache=True, nogil=True)
def read_bits(data: Array, pages: Array, values: Array) -> bool:
    """Like :func:`read_words`, truth values: ``values`` is (sum of COUNT,) int8."""
    done = 0
    for page in pages:
        at, count = page[VALUES], page[COUNT]
        if page[END] - at != (count + 7) >> 3:
            return False
        for i in range(count):
            values[done + i] = data[at + (i >> 3)] >> (i & 7) & 1
        done += count
    return True


@njit(cache=True, nogil=True)
def read_texts(data: Array, pages: Array, offsets: Array, text: Array) -> bool:
    """Like :func:`read_words`, texts.

    Args:
        offsets: (1 + sum of COUNT,) int64, filled from the second on: where texts end; the first says where to begin.
        text: (n,) uint8, filled from there on: texts one after the other.
    """
    done, size = 0, offsets[0]
    for page in pages:
        at, end = page[VALUES], page[END]
        for i in range(page[COUNT]):
            length = _uint32(data, at) if at + 4 <= end else end
            at += 4
            if length > end - at:
                return False
            for k in range(length):
                text[size + k] = data[at + k]
            at, size = at + length, size + length
            offsets[done + i + 1] = size
        if at != end:
            return False
        done += page[COUNT]
    return True


@njit(cache=True, nogil=True)
def read_indices(data: Array, pages: Array, codes: Array, values: Array) -> bool:
    """Like :func:`read_words`, words of a dictionary: ``values`` is (sum of COUNT,) int32.

    Args:
        codes: (sum of NUM_WORDS,) int32 what stands for each page's words, page by page.
    """
    done, first = 0, 0
    for page in pages:
        stop = done + page[COUNT]
        if not _read_indices(data, page[VALUES], page[END], values[done:stop]):
            return False
        for i in range(done, stop):
            if values[i] >= page[NUM_WORDS]:
                return False
            values[i] = codes[first + values[i]]
        done, first = stop, first + page[NUM_WORDS]
    return True


@njit(nogil=True)
def _read_indices(data: Array, at: int, end: int, values: Array) -> bool:
    """Indices of a page: their width, and the hybrid; returns whether all are there."""
    if at >= end:
        return len(values) == 0
    width = _byte(data, at)
    at, done = at + 1, 0
    if width > 24:  # of words, not of rows
        return False
    while done < len(values) and at < end:
        header, at = count_at(data, at)
        is_packed, length = header & 1, header >> 1
        stop = min(done + (length << 3 if is_packed else length), len(values))
        size = ((stop - done) * width if is_packed else width) + 7 >> 3
        if at + size > end:
            return False
        for place in range(stop - done):
            bit = place * width if is_packed else 0
            values[done + place] = _uint32(data, at + (bit >> 3)) >> (bit & 7) & ((1 << width) - 1)
        at += length * width if is_packed else size
        done = stop
    return done == len(values)


@njit(nogil=True)
def _join(streams: Array, count: int, values: Array) -> None:
    """Words from their first, second, third and fourth bytes, one stream after the other."""
    first, second = streams[:count], streams[count : 2 * count]
    third, fourth = streams[2 * count : 3 * count], streams[3 * count : 4 * count]
    for i in range(count):
        low = np.uint32(first[i]) | np.uint32(second[i]) << np.uint32(8)
        values[i] = low | np.uint32(third[i]) << np.uint32(16) | np.uint32(fourth[i]) << np.uint32(24)


@njit(inline="always")
def _read_levels(data: Array, page: Array, shape: int, lengths: Array) -> tuple[int, int, int]:
    """Lengths of a page's rows; their number (or UNKNOWN), the number of values, and where these begin."""
    at, end, num_levels = page[START], page[END], page[LEVELS]
    rows, empty = num_levels, 0
    if not shape & LIST:
        for row in range(num_levels):
            lengths[row] = 1
    else:
        stop = _levels_end(data, at, end)
        rows = UNKNOWN if stop == UNKNOWN else _count_levels(data, at + 4, stop, num_levels, lengths)
        at = stop
    if shape & NULLABLE or (shape & LIST and rows != UNKNOWN):
        stop = UNKNOWN if rows == UNKNOWN else _levels_end(data, at, end)
        deepest = 2 if shape == NULLABLE | LIST else 1
        empty = UNKNOWN if stop == UNKNOWN else _mark_empty(data, at + 4, stop, num_levels, deepest, lengths)
        at = stop
    return UNKNOWN if empty == UNKNOWN else rows, num_levels - empty, at


@njit(nogil=True)
def _levels_end(data: Array, at: int, end: int) -> int:
    """Where levels end that begin with their size."""
    if end - at < 4:
        return UNKNOWN
    stop = at + 4 + _uint32(data, at)
    return stop if stop <= end else UNKNOWN


@njit(nogil=True)
def _count_levels(data: Array, at: int, end: int, num_levels: int, lengths: Array) -> int:
    """Levels of each list, from repetition levels: 0 where a list begins, else 1; returns the number of lists."""
    done, rows, begin = 0, 0, 0
    while done < num_levels and at < end:
        header, at = count_at(data, at)
        is_packed, length = header & 1, header >> 1
        stop = min(done + (length << 3 if is_packed else length), num_levels)
        size = (stop - done + 7) >> 3 if is_packed else 1
        if at + size > end or (done == 0 and size and data[at] & 1):  # no list begins with the first level
            return UNKNOWN
        has_none = not is_packed and data[at] & 1
        for place in range(done, done if has_none else stop, 8):
            bits = data[at + ((place - done) >> 3)] if is_packed else data[at]
            if bits == 255:
                continue
            for level in range(place, min(place + 8, stop)):
                if bits >> (level - place) & 1 == 0:
                    lengths[max(rows - 1, 0)] = level - begin
                    rows, begin = rows + 1, level
        at += length if is_packed else 1
        done = stop
    if done < num_levels or rows == 0:
        return UNKNOWN
    lengths[rows - 1] = num_levels - begin
    return rows


@njit(nogil=True)
def _mark_empty(data: Array, at: int, end: int, num_levels: int, deepest: int, lengths: Array) -> int:
    """Set lengths of rows without values to 0: their one definition level is not the deepest; returns their number.

    Levels have 1 bit each, or 2 where ``deepest`` is 2; both never cross a byte.
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
        for first in range(done, stop, 1 << shift):
            bits = data[at + ((first - done) >> shift)] if is_packed else data[at]
            if bits == (full if is_packed else deepest):
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


@njit(nogil=True)
def _uint32(data: Array, at: int) -> Any:
    low = _byte(data, at) | _byte(data, at + 1) << 8
    return low | _byte(data, at + 2) << 16 | _byte(data, at + 3) << 24


@njit(inline="always")
def _byte(data: Array, at: int) -> Any:
    """A byte to reckon with: of an unsigned and a signed number compiled code makes a float."""
    return np.int64(data[at])
