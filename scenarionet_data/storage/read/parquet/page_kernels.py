"""Compiled loops that locate and decompress pages.

Format: https://parquet.apache.org/docs/file-format/ (data pages of version 1; levels and dictionary indices in the
RLE/bit-packed hybrid; values PLAIN or in BYTE_STREAM_SPLIT).
Damaged bytes result in ``UNKNOWN`` or ``DAMAGED``; nothing is read or written out of bounds.

The kernels release the interpreter lock, so that threads decode in parallel.

Levels are decoded by ``level_kernels``. Rows of a column are described by ``lengths``: that of the row's list, or 1 for
a value and 0 for null.
"""

from __future__ import annotations

from scenarionet_data.arrays.dtypes import Array
from scenarionet_data.compiled.decorators import device_function
from scenarionet_data.storage.read.parquet.lz4_kernels import decompress
from scenarionet_data.storage.read.parquet.thrift_kernels import (
    DATA_PAGE,
    DICTIONARY_PAGE,
    UNKNOWN,
    read_header,
)

DAMAGED = -2

# Columns of an array of chunks: position of the chunk and of its data page in the file, end, number of values with
# nulls and empty lists, codec, uncompressed size, encoding of the data page, whether the kernels can decode it, and the
# largest number of values that it can hold.
NUM_CHUNK_FIELDS = 9
CHUNK_START, DATA_START, CHUNK_END, NUM_VALUES, CODEC = range(5)
CHUNK_SIZE, EXPECTED, CAN_DECODE, CHUNK_ROOM = range(5, NUM_CHUNK_FIELDS)
OTHER_CODEC, LZ4, ZSTD = 0, 1, 2

# Columns of an array of pages: start (or UNKNOWN, DAMAGED) and end of the uncompressed page, number of levels,
# encoding, place, bytes and number of words of the dictionary, start and end in the file of a page that is still
# compressed, and start and number of the values.
NUM_PAGE_FIELDS = 11
START, END, LEVELS, ENCODING, WORDS_PLACE, WORDS_SIZE, NUM_WORDS = range(7)
STORED, STORED_END, VALUES, COUNT = range(7, NUM_PAGE_FIELDS)
PLAIN, BYTE_STREAM_SPLIT, INDICES = 0, 9, 8

SPARE = 4
"""Bytes allocated after the pages, because a 4-byte word may start at a page's last byte."""


@device_function
def load_page(data: Array, base: int, chunk: Array, page: Array, scratch: Array, at: int, words: Array) -> int:
    """Load a column's page into ``scratch`` from ``at`` on, and its dictionary into ``words``; returns its start.

    A page in zstd is only located. The result is UNKNOWN for more than one page or pages of another kind, and DAMAGED
    for those that are inconsistent.
    """
    first, middle, end = chunk[CHUNK_START] - base, chunk[DATA_START] - base, chunk[CHUNK_END] - base
    codec, limit = chunk[CODEC], min(at + chunk[CHUNK_SIZE], len(scratch) - SPARE)
    if not 0 <= first <= middle <= end <= len(data) or codec == OTHER_CODEC:
        return UNKNOWN
    if first < middle:  # a dictionary before the data page
        kind, size, stored_size, _, _ = read_header(data, first)
        if kind != DICTIONARY_PAGE or codec != LZ4 or stored_size > middle - first or size > len(words):
            return UNKNOWN
        if not decompress(data, middle - stored_size, middle, words, 0, size):
            return DAMAGED
        page[WORDS_SIZE] = size
    kind, size, stored_size, count, encoding = read_header(data, middle)
    is_known = kind == DATA_PAGE and count == chunk[NUM_VALUES] and encoding == chunk[EXPECTED] and chunk[CAN_DECODE]
    if not is_known or stored_size > end - middle or size > limit - at:  # one of several pages does not hold all levels
        return UNKNOWN
    page[END], page[LEVELS], page[ENCODING] = at + size, count, encoding
    if codec == ZSTD:
        page[STORED], page[STORED_END] = end - stored_size, end
    elif not decompress(data, end - stored_size, end, scratch, at, at + size):
        return DAMAGED
    return at
