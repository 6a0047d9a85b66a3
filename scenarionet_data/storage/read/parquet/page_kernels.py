"""Compiled decoder of Parquet pages: a column of many row groups in one call.

Format: https://parquet.apache.org/docs/file-format/ (data pages of version 1; levels and dictionary indices in the
RLE/bit-packed hybrid; values PLAIN or in BYTE_STREAM_SPLIT). Pages of sealed files are compared with their CRC-32.
Damaged bytes result in ``UNKNOWN`` or ``DAMAGED``; nothing is read or written out of bounds.

The kernels release the interpreter lock, so that threads decode in parallel.

Levels are decoded by ``level_kernels``. Rows of a column are described by ``lengths``: that of the row's list, or 1 for
a value and 0 for null.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from scenarionet_data.arrays.compiled import device_function, kernel
from scenarionet_data.arrays.dtypes import Array
from scenarionet_data.storage.read.parquet.crc_kernels import crc32
from scenarionet_data.storage.read.parquet.lz4_kernels import decompress
from scenarionet_data.storage.read.parquet.thrift_kernels import (
    DATA_PAGE,
    DICTIONARY_PAGE,
    UNKNOWN,
    count_at,
    read_header,
)

DAMAGED = -2

# Columns of an array of chunks: position of the chunk and of its data page in the file, end, number of values with
# nulls and empty lists, codec, uncompressed size, encoding of the data page, whether the kernels can decode it,
# and whether pages must have a checksum.
NUM_CHUNK_FIELDS = 9
CHUNK_START, DATA_START, CHUNK_END, NUM_VALUES, CODEC = range(5)
CHUNK_SIZE, EXPECTED, CAN_DECODE, IS_CHECKED = range(5, NUM_CHUNK_FIELDS)
OTHER_CODEC, LZ4, ZSTD = 0, 1, 2

# Columns of an array of pages: start (or UNKNOWN, DAMAGED) and end of the uncompressed page, number of levels,
# encoding, start, end and number of words of the dictionary, start and end in the file of a page that is still
# compressed, and start and number of the values.
NUM_PAGE_FIELDS = 11
START, END, LEVELS, ENCODING, WORDS_START, WORDS_END, NUM_WORDS = range(7)
STORED, STORED_END, VALUES, COUNT = range(7, NUM_PAGE_FIELDS)
PLAIN, BYTE_STREAM_SPLIT, INDICES = 0, 9, 8

SPARE = 4
"""Bytes allocated after the pages, because a 4-byte word may start at a page's last byte."""

# Shapes of a column.
NULLABLE, LIST = 1, 2


def is_compiled() -> bool:
    """Whether this process has compiled the kernels or loaded them from the cache."""
    return bool(getattr(load_pages, "signatures", True))


@kernel(nogil=True)
def load_pages(data: Array, base: int, chunks: Array, pages: Array, number: int, scratch: Array, at: int) -> int:
    """Locate a row group's pages; decompress those in LZ4, and reserve space for those in zstd.

    Args:
        data: (n,) uint8 bytes of the file, starting at position ``base``.
        chunks: (C, NUM_CHUNK_FIELDS) int64, see CHUNK_START.
        pages: (C, k, NUM_PAGE_FIELDS) int64 zeros, filled for row group ``number``; UNKNOWN for a column with more than
            one page or of another kind.
        number: Index of the row group.
        scratch: (m,) uint8, filled from ``at`` on; large enough for the chunks of known codecs.

    Returns:
        Start of the next row group's pages in ``scratch``.
    """
    for column in range(len(chunks)):
        size = chunks[column, CHUNK_SIZE] if chunks[column, CODEC] != OTHER_CODEC else 0
        limit = min(at + size, len(scratch))
        page = pages[column, number]
        page[START] = _load_page(data, base, chunks[column], page, scratch, at, limit)
        at = limit
    return at


@device_function
def _load_page(data: Array, base: int, chunk: Array, page: Array, scratch: Array, at: int, limit: int) -> int:
    """Load a column's page into ``scratch`` between ``at`` and ``limit``; returns its start."""
    first, middle, end = chunk[CHUNK_START] - base, chunk[DATA_START] - base, chunk[CHUNK_END] - base
    codec = chunk[CODEC]
    if not 0 <= first <= middle <= end <= len(data) or codec == OTHER_CODEC:
        return UNKNOWN
    if first < middle:  # a dictionary before the data page
        kind, size, stored_size, checksum, count, _ = read_header(data, first)
        if kind != DICTIONARY_PAGE or codec != LZ4 or stored_size > middle - first or size > limit - at:
            return UNKNOWN
        if chunk[IS_CHECKED] and checksum != crc32(data, middle - stored_size, middle):
            return DAMAGED
        if not decompress(data, middle - stored_size, middle, scratch, at, at + size):
            return DAMAGED
        page[WORDS_START], page[WORDS_END], page[NUM_WORDS] = at, at + size, count
        at += size
    kind, size, stored_size, checksum, count, encoding = read_header(data, middle)
    is_known = kind == DATA_PAGE and count == chunk[NUM_VALUES] and encoding == chunk[EXPECTED] and chunk[CAN_DECODE]
    if not is_known or stored_size > end - middle or size > limit - at:  # one of several pages does not hold all levels
        return UNKNOWN
    if chunk[IS_CHECKED] and checksum != crc32(data, end - stored_size, end):
        return DAMAGED
    page[END], page[LEVELS], page[ENCODING] = at + size, count, encoding
    if codec == ZSTD:
        page[STORED], page[STORED_END] = end - stored_size, end
    elif not decompress(data, end - stored_size, end, scratch, at, at + size):
        return DAMAGED
    return at


@kernel(nogil=True)
def read_words(data: Array, pages: Array, values: Array) -> bool:
    """Decode 4-byte values, PLAIN or BYTE_STREAM_SPLIT.

    Args:
        data: (n,) uint8 decompressed pages, followed by SPARE bytes.
        pages: (k, NUM_PAGE_FIELDS) int64 pages of the column, by row group.
        values: (sum of COUNT,) uint32, filled.

    Returns:
        Whether all pages are consistent.
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
                values[done + i] = uint32_at(data, at + 4 * i)
        done += count
    return True


@kernel(nogil=True)
def read_bits(data: Array, pages: Array, values: Array) -> bool:
    """Decode truth values like :func:`read_words`; ``values`` is (sum of COUNT,) int8."""
    done = 0
    for page in pages:
        at, count = page[VALUES], page[COUNT]
        if page[END] - at != (count + 7) >> 3:
            return False
        for i in range(count):
            values[done + i] = data[at + (i >> 3)] >> (i & 7) & 1
        done += count
    return True


@kernel(nogil=True)
def read_texts(data: Array, pages: Array, offsets: Array, text: Array) -> bool:
    """Decode texts like :func:`read_words`.

    Args:
        offsets: (1 + sum of COUNT,) int64; the first is where to begin in ``text``, the others are filled with ends.
        text: (n,) uint8, filled with the concatenated texts.
    """
    done, size = 0, offsets[0]
    for page in pages:
        at, end = page[VALUES], page[END]
        for i in range(page[COUNT]):
            length = uint32_at(data, at) if at + 4 <= end else end
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


@kernel(nogil=True)
def read_indices(data: Array, pages: Array, codes: Array, values: Array) -> bool:
    """Decode dictionary indices like :func:`read_words`; ``values`` is (sum of COUNT,) int32.

    Args:
        codes: (sum of NUM_WORDS,) int32 code of each word of each page's dictionary.
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


@device_function
def _read_indices(data: Array, at: int, end: int, values: Array) -> bool:
    """Decode the indices of a page (bit width, then RLE/bit-packed hybrid); returns whether it is complete."""
    if at >= end:
        return len(values) == 0
    width = _byte(data, at)
    at, done = at + 1, 0
    if width > 24:  # more words than any vocabulary
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
            values[done + place] = uint32_at(data, at + (bit >> 3)) >> (bit & 7) & ((1 << width) - 1)
        at += length * width if is_packed else size
        done = stop
    return done == len(values)


@device_function
def _join(streams: Array, count: int, values: Array) -> None:
    """Join 4-byte words from the streams of their first, second, third and fourth bytes."""
    first, second = streams[:count], streams[count : 2 * count]
    third, fourth = streams[2 * count : 3 * count], streams[3 * count : 4 * count]
    for i in range(count):
        low = np.uint32(first[i]) | np.uint32(second[i]) << np.uint32(8)
        values[i] = low | np.uint32(third[i]) << np.uint32(16) | np.uint32(fourth[i]) << np.uint32(24)


@device_function
def uint32_at(data: Array, at: int) -> Any:
    """Return the little-endian number of 4 bytes at a position."""
    low = _byte(data, at) | _byte(data, at + 1) << 8
    return low | _byte(data, at + 2) << 16 | _byte(data, at + 3) << 24


@device_function
def _byte(data: Array, at: int) -> Any:
    """Read a byte as int64 (Numba promotes uint8 + int64 to float64)."""
    return np.int64(data[at])
