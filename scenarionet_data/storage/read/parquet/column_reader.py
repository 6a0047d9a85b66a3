"""Columns of many row groups as NumPy arrays, without Arrow where our own writer made them.

Arrow takes 5-10 us to set up a column of a row group, 30 where it is in zstd, and builds the same list lengths for
each; a scenario has 40 columns. Here compiled loops decode a column of all row groups that are wanted together. What
they do not know (several pages, version 2, other codecs and encodings) is read by Arrow.
"""

from __future__ import annotations

import struct
from collections.abc import Sequence
from functools import lru_cache
from itertools import accumulate
from typing import NamedTuple

import numpy as np
import pyarrow as pa
import zstandard

from scenarionet_data.arrays.dtypes import Array
from scenarionet_data.codec.columns import Columns, Lists
from scenarionet_data.schema.tables import Column, Table
from scenarionet_data.storage.files.errors import reading
from scenarionet_data.storage.read.parquet import page_kernels as kernels
from scenarionet_data.storage.read.parquet.row_groups import RowGroup
from scenarionet_data.storage.read.parquet.thrift_kernels import UNKNOWN

_TEXTS = ("string", "json")
_NULLS = {"float32": np.float32(np.nan), "bool": np.int8(-1), "dictionary": np.int32(-1), **dict.fromkeys(_TEXTS)}
_PLACES = [kernels.START, kernels.END, kernels.STORED, kernels.STORED_END]


class _Damaged(Exception):
    """Bytes of a column are not what was written."""


class _Found(NamedTuple):
    """A column whose pages are found: its type (or that of its lists' elements), its rows, and the number of values."""

    column: Column
    element: str
    pages: Array
    lengths: Array
    offsets: Array
    num_values: int


class ColumnReader:
    """Reads columns of one table; for one thread.

    Args:
        table: The table.
        names: Its columns to read, those of every footer.
    """

    def __init__(self, table: Table, names: Sequence[str]) -> None:
        self._columns = [table.column(name) for name in names]
        self._shapes = np.array([kernels.LIST * c.is_list + kernels.NULLABLE * c.nullable for c in self._columns])
        self._elements = [column.element for column in self._columns]
        self._zstd = zstandard.ZstdDecompressor()

    def read(self, groups: Sequence[RowGroup]) -> Columns:
        """Rows of row groups, one after the other.

        Raises:
            LakeError: A page is damaged; the message names its file.
        """
        try:
            return self._read(groups)
        except _Damaged as error:
            if len(groups) > 1:
                for group in groups:  # one of them says that it is it
                    self.read([group])
            with reading(groups[0].url):
                raise OSError(str(error)) from error

    def _read(self, groups: Sequence[RowGroup]) -> Columns:
        pages, data = self._staged(groups)
        num_rows = sum(group.num_rows for group in groups)
        found, others = self._found(pages, data, num_rows)
        texts = [each for each in found if each.element in _TEXTS]
        values = dict(zip([each.column.name for each in texts], _texts(texts, data), strict=True))
        words: dict[str, Sequence[str]] = {}
        for each in found:
            name = each.column.name
            if each.element == "dictionary":
                words[name], values[name] = _numbers_of_words(each, data)
            elif name not in values:
                values[name] = _numbers(each, data)
        flat: dict[str, Array] = {}
        lists: dict[str, Lists] = {}
        for each in found:
            name = each.column.name
            if each.column.is_list:
                lists[name] = Lists(each.lengths, each.offsets, values[name])
            else:
                flat[name] = _spread(each, values[name])
        if others:
            read = _read_by_arrow(groups, others)
            flat, lists, words = flat | {**read.flat}, lists | {**read.lists}, words | {**read.words}
        return Columns(num_rows, flat, lists, words)

    def _staged(self, groups: Sequence[RowGroup]) -> tuple[Array, Array]:
        """Pages of every column and row group, (columns, groups, NUM_PAGE_FIELDS) int64, and their bytes, inflated."""
        chunks = [group.chunks for group in groups]
        size = sum(int(each[:, kernels.CHUNK_SIZE].sum()) for each in chunks)
        data = np.empty(size + kernels.SPARE, np.uint8)
        pages = np.zeros((len(self._columns), len(groups), kernels.NUM_PAGE_FIELDS), np.int64)
        at = 0
        for place, (group, its_chunks) in enumerate(zip(groups, chunks, strict=True)):
            at = kernels.stage(group.content, group.base, its_chunks, pages, place, data, at)
        for column, place in np.argwhere(pages[:, :, kernels.STORED_END] > 0).tolist():
            start, end, *stored = pages[column, place, _PLACES].tolist()
            if not self._inflate(groups[place].content[slice(*stored)].data, data[start:end]):
                pages[column, place, kernels.START] = kernels.DAMAGED
        self._require(pages[:, :, kernels.START] != kernels.DAMAGED)
        data.flags.writeable = False  # as files are: loops are compiled for each kind of array
        return pages, data

    def _inflate(self, stored: memoryview, place: Array) -> bool:
        """Inflate a page in zstd; returns whether it fills its place."""
        try:
            # Asked first: what is longer than its place is damaged, too.
            size = zstandard.frame_content_size(stored)
            return size == len(place) == self._zstd.stream_reader(stored).readinto(place)
        except zstandard.ZstdError:
            return False

    def _found(self, pages: Array, data: Array, num_rows: int) -> tuple[list[_Found], list[Column]]:
        """Columns that compiled loops know, and those that they do not."""
        is_known = (pages[:, :, kernels.START] != UNKNOWN).all(axis=1)
        room = pages[:, :, kernels.LEVELS].sum(axis=1) + 1
        firsts, lists = np.cumsum(room) - room, np.empty((2, int(room.sum())), np.int32)
        rows = np.empty(len(pages), np.int64)
        kernels.read_levels(data, pages, self._shapes, firsts, lists, rows)
        self._require((rows == num_rows) | ~is_known)
        counts = pages[:, :, kernels.COUNT].sum(axis=1).tolist()
        found, others = [], []
        for place, (column, first) in enumerate(zip(self._columns, firsts.tolist(), strict=True)):
            if is_known[place]:
                lengths, offsets = lists[0, first : first + num_rows], lists[1, first : first + num_rows + 1]
                found.append(_Found(column, self._elements[place], pages[place], lengths, offsets, counts[place]))
            else:
                others.append(column)
        return found, others

    def _require(self, is_whole: Array) -> None:
        """Refuse columns, or their pages, that are not whole."""
        damaged = np.argwhere(~is_whole)
        if len(damaged):
            raise _Damaged(f"column {self._columns[damaged[0, 0]].name} is damaged")


def _numbers(found: _Found, data: Array) -> Array:
    """Numbers or truth values; int8 where a truth value may be null."""
    if found.element == "bool":
        values = np.empty(found.num_values, np.int8)
        is_whole = kernels.read_bits(data, found.pages, values)
        values = values if found.column.type == "bool" and found.column.nullable else values.view(np.bool_)
    else:
        values = np.empty(found.num_values, found.element)
        is_whole = kernels.read_words(data, found.pages, values.view(np.uint32))
    return _whole(found, values, is_whole)


def _numbers_of_words(found: _Found, data: Array) -> tuple[list[str], Array]:
    """Words of all pages' dictionaries, and the number of each value's word among them."""
    numbers: dict[str, int] = {}
    codes, values = [], np.empty(found.num_values, np.int32)
    for page in found.pages:
        words = _words(data[page[kernels.WORDS_START] : page[kernels.WORDS_END]].tobytes())
        page[kernels.NUM_WORDS] = len(words)
        codes += [numbers.setdefault(word, len(numbers)) for word in words]
    is_whole = kernels.read_indices(data, found.pages, np.array(codes, np.int32), values)
    return list(numbers), _whole(found, values, is_whole)


@lru_cache(1024)
def _words(page: bytes) -> tuple[str, ...]:
    """Words of a dictionary, PLAIN."""
    words, at = [], 0
    try:
        while at < len(page):
            (size,) = struct.unpack_from("<I", page, at)
            words.append(page[at + 4 : at + 4 + size].decode())
            at += 4 + size
    except (struct.error, UnicodeDecodeError) as error:
        raise _Damaged("a dictionary is damaged") from error
    return tuple(words)


def _texts(columns: Sequence[_Found], data: Array) -> list[Array]:
    """Texts of columns: all are made in one go, and each column has its part of them."""
    if not columns:
        return []
    ends = list(accumulate(found.num_values for found in columns))
    size = sum(int((found.pages[:, kernels.END] - found.pages[:, kernels.VALUES]).sum()) for found in columns)
    offsets, text = np.zeros(ends[-1] + 1, np.int64), np.empty(size, np.uint8)
    for found, end in zip(columns, ends, strict=True):
        first = end - found.num_values
        _whole(found, offsets, kernels.read_texts(data, found.pages, offsets[first:], text))
    strings = _strings(offsets, text)
    return [strings[end - found.num_values : end] for found, end in zip(columns, ends, strict=True)]


def _strings(offsets: Array, text: Array) -> Array:
    """(n,) str from texts one after the other."""
    buffers = [None, pa.py_buffer(offsets), pa.py_buffer(text)]
    array = pa.Array.from_buffers(pa.large_string(), len(offsets) - 1, buffers)
    try:
        strings: Array = array.to_numpy(zero_copy_only=False)
    except (UnicodeDecodeError, pa.ArrowException) as error:
        raise _Damaged("a text is damaged") from error
    return strings


def _whole(found: _Found, values: Array, is_whole: bool) -> Array:
    if not is_whole:
        raise _Damaged(f"column {found.column.name} is damaged")
    return values


def _spread(found: _Found, values: Array) -> Array:
    """Values with nulls, one a row."""
    if len(values) == len(found.lengths):
        return values
    spread: Array = np.full(len(found.lengths), _NULLS[found.element], values.dtype)
    spread[found.lengths > 0] = values
    return spread


def _read_by_arrow(groups: Sequence[RowGroup], columns: Sequence[Column]) -> Columns:
    """Columns that compiled loops do not know."""
    names, read = [column.name for column in columns], []
    for group in groups:
        with reading(group.url):
            read.append(group.open().read_row_group(group.number, names, use_threads=False))
    return Columns.from_arrow(pa.concat_tables(read), columns)
