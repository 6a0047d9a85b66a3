"""Compiled entries of the decoder: they read all columns of a row group in one call.

A page is decoded as soon as it is decompressed, so that it stays in the processor's fastest cache; pages in zstd are
decompressed between two calls. The kernels release the interpreter lock, so that threads decode in parallel.
"""

from __future__ import annotations

from scenarionet_data.arrays.columns import FIRST_BYTE, LAST_BYTE, ColumnBlock
from scenarionet_data.arrays.dtypes import Array
from scenarionet_data.compiled.decorators import kernel
from scenarionet_data.storage.read.parquet.page_kernels import (
    CHUNK_END,
    DAMAGED,
    END,
    NUM_WORDS,
    START,
    STORED_END,
    VALUES,
    WORDS_PLACE,
    WORDS_SIZE,
    load_page,
)
from scenarionet_data.storage.read.parquet.thrift_kernels import UNKNOWN
from scenarionet_data.storage.read.parquet.value_kernels import (
    count_words,
    decode_page,
    fill_nulls,
)


@kernel(nogil=True, allocates=False)
def read_row_group(
    data: Array,
    base: int,
    chunks: Array,
    memory: tuple[Array, Array],
    pages: Array,
    rows: tuple[int, int],
    out: ColumnBlock,
    is_decompressed: bool,
) -> int:
    """Decode the columns of a row group behind the values of those before; those in zstd by a second call.

    Pages in zstd are decompressed to their places in ``memory`` between the calls.

    Args:
        data: (n,) uint8 bytes of the file, starting at position ``base``.
        base: See ``data``.
        chunks: (C, NUM_CHUNK_FIELDS) int64, see CHUNK_START; zeros for a column that the file lacks.
        memory: uint8 memory for decompressed pages, see ``StoredGroup.scratch``, and (4, m) for the levels of one.
        pages: (C, NUM_PAGE_FIELDS) int64, filled.
        rows: First row of the row group, and its number of rows.
        out: Filled.
        is_decompressed: Whether this is the second call.

    Returns:
        The first column that is damaged, or the number of columns and of pages in zstd; UNKNOWN if a column has more
        than one page, or of another kind.
    """
    at, stored, (scratch, levels), (row, num_rows) = 0, 0, memory, rows
    for column in range(len(pages)):
        page, described = pages[column], out.columns[column]
        if is_decompressed:
            if page[STORED_END] == 0:
                page[VALUES] = 0  # its levels are not the last ones any more
                continue
        else:
            for field in range(len(page)):
                page[field] = 0
            if chunks[column, CHUNK_END] == 0:
                fill_nulls(column, row, num_rows, out)
                continue
            words = out.memory[described[FIRST_BYTE] : described[LAST_BYTE]]
            page[START] = load_page(data, base, chunks[column], page, scratch, at, words)
            if page[START] == UNKNOWN:
                return UNKNOWN
            if page[START] == DAMAGED:
                return column
            if page[WORDS_SIZE]:
                page[WORDS_PLACE], page[NUM_WORDS] = described[FIRST_BYTE], count_words(words[: page[WORDS_SIZE]])
                described[FIRST_BYTE] += page[WORDS_SIZE]
            if page[STORED_END]:
                at, stored = page[END], stored + 1
                continue
        if not decode_page(scratch, levels, pages, column, row, num_rows, out):
            return column
    return len(pages) + stored
