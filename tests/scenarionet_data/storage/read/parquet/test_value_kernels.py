"""Arbitrary pages are never read or written out of bounds, and repeated levels are read like others."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from scenarionet_data.arrays.columns import (
    BITS,
    FIRST,
    FIRST_BYTE,
    INDICES,
    KIND,
    LAST_BYTE,
    LENGTHS,
    LIST,
    NULLABLE,
    NUM_COLUMN_FIELDS,
    OFFSETS,
    ROOM,
    SHAPE,
    SIZE,
    TEXTS,
    WORDS,
    ColumnBlock,
)
from scenarionet_data.storage.read.parquet import page_kernels as pages
from scenarionet_data.storage.read.parquet import row_group_kernels as kernels

KINDS = st.sampled_from([WORDS, BITS, INDICES, TEXTS])
SHAPES = st.sampled_from([0, NULLABLE, LIST, LIST | NULLABLE])
GUARD = 7
WIDTHS = {WORDS: 4, BITS: 1, INDICES: 4, TEXTS: 8}


def memory(columns, num_rows, room, size):
    """A block for columns of some shapes and kinds, with guard values behind each array; and where these are."""
    described, used, end = np.zeros((len(columns), NUM_COLUMN_FIELDS), np.int64), [], 0

    def place(width, count):
        nonlocal end
        first = -(-end // 8) * 8
        used.append(slice(first, first + width * count))
        end = first + width * count + 8
        return first // width

    for column, (shape, kind) in zip(described, columns, strict=True):
        column[LENGTHS], column[OFFSETS] = place(4, num_rows), place(4, num_rows + 1)
        column[FIRST] = place(WIDTHS[kind], room + (kind == TEXTS))
        column[SHAPE], column[KIND], column[ROOM] = shape, kind, room
        column[FIRST_BYTE] = place(1, size)
        column[LAST_BYTE] = column[FIRST_BYTE] + size
    content = np.full(-(-end // 8) * 8, GUARD, np.uint8)
    is_guard = np.ones(len(content), np.bool_)
    for each in used:
        is_guard[each] = False
    return ColumnBlock(described, content), is_guard


def integers(block, place, count):
    """Numbers of 4 bytes from a place in memory on."""
    return block.memory.view(np.int32)[place : place + count]


def decoded(data, found, num_rows, block):
    """Decode decompressed pages; returns the first damaged column, or their number."""
    found[:, pages.STORED_END] = 1
    levels, chunks = np.zeros((4, len(data)), np.uint8), np.zeros((len(found), pages.NUM_CHUNK_FIELDS), np.int64)
    file = np.frombuffer(b"", np.uint8)
    return kernels.read_row_group(file, 0, chunks, (data, levels), found, (0, num_rows), block, True)


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
    out, is_guard = memory(columns, num_rows, room, len(data))
    done = decoded(data, found, num_rows, out)
    assert (out.memory[is_guard] == GUARD).all()
    for column in out.columns[:done]:
        lengths = integers(out, column[LENGTHS], num_rows)
        assert (lengths >= 0).all()
        assert lengths.sum() == integers(out, column[OFFSETS], num_rows + 1)[-1]
        assert column[SIZE] == (lengths.sum() if column[SHAPE] & LIST else num_rows) <= room


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
    shapes=st.lists(st.sampled_from([LIST, NULLABLE, 0]), min_size=2, max_size=2),
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
        out, _ = memory([(shapes[column], WORDS) for column in chosen], num_rows, 8, 0)
        done = decoded(data, found[chosen].copy(), num_rows, out)
        return [
            [
                integers(out, column[place], count).tolist()
                for place, count in ((LENGTHS, num_rows), (OFFSETS, num_rows + 1), (FIRST, column[SIZE]))
            ]
            for column in out.columns[:done]
        ]

    alone = read([0])
    assert read([0, 1]) == (alone + read([1]) if alone else [])


def test_indices_are_runs_and_packed_bits():
    """Five times the word 3, the words 0 to 3 twice in two bits each from the right, and twice the word 1."""
    content = b"\2" + bytes([5 << 1, 3]) + bytes([1 << 1 | 1, 0b11100100, 0b11100100]) + bytes([2 << 1, 1])
    data, found = np.frombuffer(content + bytes(pages.SPARE), np.uint8), np.zeros((1, pages.NUM_PAGE_FIELDS), np.int64)
    found[0, pages.END], found[0, pages.LEVELS], found[0, pages.NUM_WORDS] = len(content), 15, 4
    out, _ = memory([(0, INDICES)], 15, 15, 0)
    assert decoded(data.copy(), found, 15, out) == 1
    assert integers(out, out.columns[0, FIRST], 15).tolist() == [3] * 5 + [0, 1, 2, 3] * 2 + [1] * 2


def test_indices_beyond_the_words_are_damage():
    content = b"\2" + bytes([5 << 1, 3])
    data, found = np.frombuffer(content + bytes(pages.SPARE), np.uint8), np.zeros((1, pages.NUM_PAGE_FIELDS), np.int64)
    found[0, pages.END], found[0, pages.LEVELS] = len(content), 5
    for num_words, done in ((4, 1), (3, 0)):
        found[0, pages.NUM_WORDS] = num_words
        assert decoded(data.copy(), found.copy(), 5, memory([(0, INDICES)], 5, 5, 0)[0]) == done


def text_page(text, room):
    """Decode a page of one text, with room for so many bytes; returns whether it is UTF-8, and the guards' values."""
    content = len(text).to_bytes(4, "little") + text
    data = np.frombuffer(content + bytes(pages.SPARE + 32), np.uint8).copy()
    found = np.zeros((1, pages.NUM_PAGE_FIELDS), np.int64)
    found[0, pages.END], found[0, pages.LEVELS] = len(content), 1
    out, is_guard = memory([(0, TEXTS)], 1, 1, room)
    return decoded(data, found, 1, out) == 1, out.memory[is_guard]


def test_texts_are_those_that_python_decodes():
    for lead in range(256):
        for second in (0x41, 0x7F, 0x80, 0x8F, 0x90, 0x9F, 0xA0, 0xBF, 0xC0):
            for length in range(1, 5):
                text = bytes([lead, second, 0x80, 0xBF])[:length]
                try:
                    is_text = bool(text.decode())
                except UnicodeDecodeError:
                    is_text = False
                assert text_page(text, 64)[0] == is_text, text


def test_no_byte_is_written_behind_the_room_of_texts():
    for length in range(20):
        for room in range(length + 4, 40):  # for the whole page
            is_text, guards = text_page(b"x" * length, room)
            assert is_text and (guards == GUARD).all(), (room, length)
