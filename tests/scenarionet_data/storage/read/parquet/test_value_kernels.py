"""Arbitrary pages are never read or written out of bounds, and repeated levels are read like others."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from scenarionet_data.arrays.columns import BITS, INDICES, TEXTS, WORDS, ColumnBlock
from scenarionet_data.storage.read.parquet import page_kernels as pages
from scenarionet_data.storage.read.parquet import row_group_kernels as kernels

KINDS = st.sampled_from([WORDS, BITS, INDICES, TEXTS])
SHAPES = st.sampled_from([0, pages.NULLABLE, pages.LIST, pages.LIST | pages.NULLABLE])
GUARD = 7


def memory(num_columns, num_rows, room, size):
    """Memory for values, with guard values behind each array, and the arrays that hold both."""
    arrays = [
        np.full(count + 8, GUARD, kind)
        for count, kind in [
            (2 * num_columns * (num_rows + 1), np.int32), (num_columns, np.int64), (num_columns, np.int64),
            (num_columns * room, np.uint32), (num_columns * room, np.int8), (num_columns * (room + 1), np.int64),
            (num_columns * size, np.uint8),
        ]
    ]  # fmt: skip
    lists, firsts, counts, words, bits, ends, text = (array[:-8] for array in arrays)
    counts[:] = 0
    return ColumnBlock(
        lists.reshape(2, num_columns, num_rows + 1), firsts, counts, words, words.view(np.float32), bits, ends, text
    ), arrays


def described(columns, room, size, block):
    """Columns of some shapes and kinds; each has its own place in the values."""
    for place, (_, kind) in enumerate(columns):
        block.firsts[place] = place * (room + (kind == TEXTS))
    return np.array(
        [(*column, room, place * size, (place + 1) * size) for place, column in enumerate(columns)], np.int64
    )


def decoded(data, found, columns, num_rows, block):
    """Decode decompressed pages; returns the first damaged column, or their number."""
    found[:, pages.STORED_END] = 1
    levels, chunks = np.zeros((4, len(data)), np.uint8), np.zeros((len(found), pages.NUM_CHUNK_FIELDS), np.int64)
    file = np.frombuffer(b"", np.uint8)
    return kernels.read_row_group(file, 0, chunks, data, levels, found, columns, 0, num_rows, block, True)


@given(
    contents=st.lists(st.binary(max_size=120), min_size=2, max_size=2),
    columns=st.lists(st.tuples(SHAPES, KINDS), min_size=2, max_size=2),
    levels=st.lists(st.integers(0, 60), min_size=2, max_size=2),
    encoding=st.sampled_from([pages.PLAIN, pages.BYTE_STREAM_SPLIT]),
    num_words=st.integers(0, 4),
    num_rows=st.integers(0, 60),
    room=st.integers(0, 60),
)
def test_arbitrary_pages_stay_in_bounds(contents, columns, levels, encoding, num_words, num_rows, room):
    data = np.frombuffer(b"".join(contents) + bytes(pages.SPARE), np.uint8).copy()
    found = np.zeros((2, pages.NUM_PAGE_FIELDS), np.int64)
    found[:, pages.END] = np.cumsum([len(content) for content in contents])
    found[1, pages.START] = found[0, pages.END]
    found[:, pages.LEVELS] = levels
    found[:, [pages.ENCODING, pages.NUM_WORDS]] = encoding, num_words
    out, arrays = memory(2, num_rows, room, len(data))
    done = decoded(data, found, described(columns, room, len(data), out), num_rows, out)
    assert all((array[-8:] == GUARD).all() for array in arrays)
    for column in range(done):
        assert (out.lists[0, column, :-1] >= 0).all()
        num_values = out.lists[0, column, :-1].sum()
        assert num_values == out.lists[1, column, -1]
        assert out.counts[column] == (num_values if columns[column][0] & pages.LIST else num_rows) <= room


LEVELS_OF_LISTS = b"\2\0\0\0\3\x16"
"""Repetition levels of lists of 3, 2, 1, 1 and 1 elements: 0 1 1 0 1 0 0 0, in bits from the right 00010110."""
FULL, HALF_EMPTY = b"\2\0\0\0\x10\1", b"\4\0\0\0\x08\1\x08\0"
"""Definition levels of 8 values, and of 4 values before 4 without."""


@given(
    levels=st.lists(
        st.sampled_from([LEVELS_OF_LISTS + FULL, LEVELS_OF_LISTS + HALF_EMPTY, FULL, HALF_EMPTY, b""]),
        min_size=2,
        max_size=2,
    ),
    shapes=st.lists(st.sampled_from([pages.LIST, pages.NULLABLE, 0]), min_size=2, max_size=2),
    num_rows=st.sampled_from([5, 8]),
)
def test_columns_that_repeat_levels_are_read_as_if_alone(levels, shapes, num_rows):
    values_of = b"".join(bytes([k, 0, 0, 0]) for k in range(8))
    contents = [each + values_of[: 16 if each.endswith(HALF_EMPTY) else 32] for each in levels]
    data = np.frombuffer(b"".join(contents) + bytes(pages.SPARE), np.uint8).copy()
    found = np.zeros((2, pages.NUM_PAGE_FIELDS), np.int64)
    found[:, pages.END] = np.cumsum([len(content) for content in contents])
    found[1, pages.START], found[:, pages.LEVELS] = found[0, pages.END], 8

    def read(chosen):
        out, _ = memory(len(chosen), num_rows, 8, 0)
        columns = described([(shapes[column], WORDS) for column in chosen], 8, 0, out)
        done = decoded(data, found[chosen].copy(), columns, num_rows, out)
        return [
            (out.lists[:, k].tolist(), count, out.words[8 * k : 8 * k + count].tolist())
            for k, count in zip(range(done), out.counts.tolist(), strict=False)
        ]

    alone = read([0])
    assert read([0, 1]) == (alone + read([1]) if alone else [])
