"""Columns of many row groups as NumPy arrays, without Arrow where our own writer made them.

Arrow takes 5-10 us to set up a column of a row group, 30 where it is in zstd, and builds the same list lengths for
each; a scenario has 40 columns. Here compiled loops decode a column of all row groups that are wanted together. What
they do not know (several pages, version 2, other codecs and encodings) is read by Arrow.
"""

from __future__ import annotations

import struct
from collections.abc import Sequence
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt
import pyarrow as pa
import zstandard

from scenarionet_data.codec.columns import Columns, Lists
from scenarionet_data.store import page_kernels as kernels
from scenarionet_data.store.file_errors import reading
from scenarionet_data.store.row_groups import RowGroup
from scenarionet_data.store.thrift_kernels import UNKNOWN
from scenarionet_data.tables import Column, Table

Array = npt.NDArray[Any]

_TEXTS = ("string", "json")
_NULLS = {"float32": np.float32(np.nan), "bool": np.int8(-1), "dictionary": np.int32(-1), **dict.fromkeys(_TEXTS)}
_PLACES = [kernels.START, kernels.END, kernels.STORED, kernels.STORED_END]


class _Damaged(Exception):
    """Bytes of a column are not what was written."""


class ColumnReader:
    """Reads columns of one table; for one thread.

    Args:
        table: The table.
        names: Its columns to read, those of every footer.
    """

    def __init__(self, table: Table, names: Sequence[str]) -> None:
        columns = [table.column(name) for name in names]
        shapes = [kernels.LIST * column.is_list + kernels.NULLABLE * column.nullable for column in columns]
        self._columns = [_Wanted(column, column.element, shape) for column, shape in zip(columns, shapes, strict=True)]
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
        is_known = (pages[:, :, kernels.START] != UNKNOWN).all(axis=1).tolist()
        num_levels = pages[:, :, kernels.LEVELS].sum(axis=1).tolist()
        read = _Read(data, sum(group.num_rows for group in groups))
        texts, others = [], []
        for wanted, its_pages, known, levels in zip(self._columns, pages, is_known, num_levels, strict=True):
            if not known:
                others.append(wanted.column)
            elif wanted.element in _TEXTS:
                texts.append((wanted, its_pages, levels))
            elif wanted.element == "dictionary":
                read.words(wanted, its_pages, levels)
            else:
                read.numbers(wanted, its_pages, levels)
        read.texts(texts)
        if others:
            read.by_arrow(groups, others)
        return Columns(read.num_rows, read.flat, read.lists, read.known_words)

    def _staged(self, groups: Sequence[RowGroup]) -> tuple[Array, Array]:
        """Pages of every column and row group, (columns, groups, NUM_PAGE_FIELDS) int64, and their bytes, inflated."""
        chunks = [group.chunks for group in groups]
        data = np.empty(sum(int(each[:, kernels.CHUNK_SIZE].sum()) for each in chunks), np.uint8)
        pages = np.empty((len(self._columns), len(groups), kernels.NUM_PAGE_FIELDS), np.int64)
        at = 0
        for place, (group, its_chunks) in enumerate(zip(groups, chunks, strict=True)):
            at = kernels.stage(group.content, group.base, its_chunks, pages[:, place], data, at)
        for column, place in np.argwhere(pages[:, :, kernels.STORED_END] > 0).tolist():
            start, end, *stored = pages[column, place, _PLACES].tolist()
            if not self._inflate(groups[place].content[slice(*stored)].data, data[start:end]):
                pages[column, place, kernels.START] = kernels.DAMAGED
        damaged = np.flatnonzero((pages[:, :, kernels.START] == kernels.DAMAGED).any(axis=1))
        if len(damaged):
            raise _Damaged(f"column {self._columns[damaged[0]].column.name} is damaged")
        return pages, data

    def _inflate(self, stored: memoryview, place: Array) -> bool:
        """Inflate a page in zstd; returns whether it fills its place."""
        try:
            # Asked first: what is longer than its place is damaged, too.
            size = zstandard.frame_content_size(stored)
            return size == len(place) == self._zstd.stream_reader(stored).readinto(place)
        except zstandard.ZstdError:
            return False


class _Wanted(NamedTuple):
    """A column to read: its type, or that of its lists' elements, and its shape for compiled loops."""

    column: Column
    element: str
    shape: int


class _Read:
    """Columns as they are decoded.

    Args:
        data: (n,) uint8 inflated pages.
        num_rows: Rows that every column has.
    """

    def __init__(self, data: Array, num_rows: int) -> None:
        self._data = data
        self.num_rows = num_rows
        self.flat: dict[str, Array] = {}
        self.lists: dict[str, Lists] = {}
        self.known_words: dict[str, Sequence[str]] = {}

    def numbers(self, wanted: _Wanted, pages: Array, num_levels: int) -> None:
        """Add a column of numbers or truth values."""
        lists = np.empty((2, num_levels + 1), np.int32)
        if wanted.element == "bool":
            values = np.empty(num_levels, np.int8)
            rows, done = kernels.read_bits(self._data, pages, wanted.shape, lists, values)
            values = values if wanted.shape == kernels.NULLABLE else values.view(np.bool_)
        else:
            values = np.empty(num_levels, wanted.element)
            rows, done = kernels.read_words(self._data, pages, wanted.shape, lists, values.view(np.uint32))
        self._add(wanted, rows, lists, values[:done])

    def words(self, wanted: _Wanted, pages: Array, num_levels: int) -> None:
        """Add a column of a dictionary's words."""
        lists, values = np.empty((2, num_levels + 1), np.int32), np.empty(num_levels, np.int32)
        self.known_words[wanted.column.name], codes = self._unified(pages)
        rows, done = kernels.read_indices(self._data, pages, wanted.shape, codes, lists, values)
        self._add(wanted, rows, lists, values[:done])

    def _unified(self, pages: Array) -> tuple[list[str], Array]:
        """Words of all pages' dictionaries, and which of them each word of each page is."""
        numbers: dict[str, int] = {}
        codes = []
        for page in pages:
            words = _words(self._data[page[kernels.WORDS_START] : page[kernels.WORDS_END]].tobytes())
            page[kernels.NUM_WORDS] = len(words)
            codes += [numbers.setdefault(word, len(numbers)) for word in words]
        return list(numbers), np.array(codes, np.int32)

    def texts(self, columns: Sequence[tuple[_Wanted, Array, int]]) -> None:
        """Add columns of texts: all of them as one array, of which each is a part."""
        if not columns:
            return
        size = sum(int(pages[:, kernels.SIZE].sum()) for _, pages, _ in columns)
        text, ends = np.empty(size, np.uint8), np.zeros(sum(levels for _, _, levels in columns) + 1, np.int64)
        first, found = 0, []
        for wanted, pages, num_levels in columns:
            lists = np.empty((2, num_levels + 1), np.int32)
            rows, done = kernels.read_texts(self._data, pages, wanted.shape, lists, ends[first:], text)
            found.append((wanted, rows, lists, slice(first, first + done)))
            first += done
        strings = _strings(ends[: first + 1], text)
        for wanted, rows, lists, place in found:
            self._add(wanted, rows, lists, strings[place])

    def by_arrow(self, groups: Sequence[RowGroup], columns: Sequence[Column]) -> None:
        """Add columns that compiled loops do not know."""
        names, read = [column.name for column in columns], []
        for group in groups:
            with reading(group.url):
                read.append(group.open().read_row_group(group.number, names, use_threads=False))
        found = Columns.from_arrow(pa.concat_tables(read), columns)
        self.flat.update(found.flat)
        self.lists.update(found.lists)
        self.known_words.update(found.words)

    def _add(self, wanted: _Wanted, rows: int, lists: Array, values: Array) -> None:
        """Add a column of ``rows`` lists, or values and nulls."""
        if rows != self.num_rows:
            raise _Damaged(f"column {wanted.column.name} is damaged")
        if wanted.shape & kernels.LIST:
            self.lists[wanted.column.name] = Lists(lists[0, :rows], lists[1, : rows + 1], values)
        elif len(values) == rows:
            self.flat[wanted.column.name] = values
        else:
            spread = np.full(rows, _NULLS[wanted.element], values.dtype)
            spread[lists[0, :rows] > 0] = values
            self.flat[wanted.column.name] = spread


def _strings(offsets: Array, text: Array) -> Array:
    """(n,) str from texts one after the other."""
    buffers = [None, pa.py_buffer(offsets), pa.py_buffer(text)]
    array = pa.Array.from_buffers(pa.large_string(), len(offsets) - 1, buffers)
    try:
        strings: Array = array.to_numpy(zero_copy_only=False)
    except (UnicodeDecodeError, pa.ArrowException) as error:
        raise _Damaged("a text is damaged") from error
    return strings


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
