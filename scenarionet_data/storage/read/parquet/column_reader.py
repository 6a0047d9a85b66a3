"""Decode columns of many row groups as NumPy arrays.

Arrow takes 5-10 us to set up a column of a row group, 30 us with zstd, and decodes the same list lengths for each
column; a scenario has 40 columns. The kernels decode a column of all requested row groups in one call. They know what
our writer produces; other encodings (several pages, data pages of version 2, other codecs) are decoded by Arrow, and so
are the first row groups of a process, because the kernels take seconds to compile where they are not cached.
"""

from __future__ import annotations

import struct
from collections.abc import Sequence
from functools import lru_cache
from itertools import accumulate, groupby
from typing import NamedTuple

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import zstandard

from scenarionet_data.arrays.columns import Columns, ColumnType, Lists
from scenarionet_data.arrays.dtypes import Array
from scenarionet_data.arrays.memory import Memory
from scenarionet_data.storage.footers.thrift import Malformed
from scenarionet_data.storage.read.parquet import page_kernels as kernels
from scenarionet_data.storage.read.parquet.footer import Footer, RowGroup, UnreadableFile
from scenarionet_data.storage.read.parquet.level_kernels import read_levels
from scenarionet_data.storage.read.parquet.page_checks import check_pages
from scenarionet_data.storage.read.parquet.thrift_kernels import UNKNOWN

COMPILE_AFTER = 64
"""Row groups that a reader leaves to Arrow before it compiles the kernels: compiling costs as much as 1,500."""
_TEXT = ("string", "json")
_NULLS = {"float32": np.float32(np.nan), "bool": np.int8(-1), "dictionary": np.int32(-1), **dict.fromkeys(_TEXT)}
_POSITIONS = [kernels.START, kernels.END, kernels.STORED, kernels.STORED_END]


class _Damaged(Exception):
    """The bytes of a column are damaged."""


class _Pages(NamedTuple):
    """The pages of a column in all row groups, with the lengths and offsets of its rows and the number of values."""

    column: ColumnType
    pages: Array
    lengths: Array
    offsets: Array
    num_values: int


class ColumnReader:
    """Reads columns of one table; for one thread.

    Args:
        columns: The columns.
        memory: Memory for pages and values; of its own by default.
        compile_after: Row groups that are left to Arrow unless the kernels are compiled already.
    """

    def __init__(
        self, columns: Sequence[ColumnType], memory: Memory | None = None, compile_after: int = COMPILE_AFTER
    ) -> None:
        self._columns = list(columns)
        self._shapes = np.array([kernels.LIST * c.is_list + kernels.NULLABLE * c.nullable for c in self._columns])
        self._zstd = zstandard.ZstdDecompressor()
        self._left_to_arrow = compile_after
        self._memory = memory or Memory()

    def footer(self, url: str, metadata: pq.FileMetaData, *, has_checksums: bool = False) -> Footer:
        """Locate the columns in a file.

        Args:
            url: The file, for errors.
            metadata: Its footer.
            has_checksums: Whether every page has a checksum; it is verified.

        Raises:
            UnreadableFile: A required column is missing.
        """
        return Footer(url, metadata, self._columns, has_checksums)

    def read(self, groups: Sequence[RowGroup]) -> Columns:
        """Rows of some row groups, concatenated.

        Raises:
            UnreadableFile: A page is damaged.
        """
        if self._left_to_arrow > 0 and not kernels.is_compiled():
            self._left_to_arrow -= len(groups)
            return _read_by_arrow(groups, self._columns)
        try:
            return self._read(groups)
        except _Damaged as error:
            if len(groups) > 1:
                for group in groups:  # raises for the damaged one
                    self.read([group])
            raise UnreadableFile(groups[0].footer.url, str(error)) from error

    def _read(self, groups: Sequence[RowGroup]) -> Columns:
        pages, data = self._load_pages(groups)
        num_rows = sum(group.num_rows for group in groups)
        known, others = self._read_levels(pages, data, num_rows)
        texts = [each for each in known if each.column.element in _TEXT]
        values = dict(zip([each.column.name for each in texts], _texts(texts, data), strict=True))
        words: dict[str, Sequence[str]] = {}
        flat: dict[str, Array] = {}
        lists: dict[str, Lists] = {}
        for each in known:
            name = each.column.name
            if each.column.element == "dictionary":
                words[name], values[name] = _indices(each, data)
            elif name not in values:
                values[name] = self._numbers(each, data)
            if each.column.is_list:
                lists[name] = Lists(each.lengths, each.offsets, values[name])
            else:
                flat[name] = _with_nulls(each, values[name])
        if others:
            read = _read_by_arrow(groups, others)
            flat, lists, words = flat | {**read.flat}, lists | {**read.lists}, words | {**read.words}
        return Columns(num_rows, flat, lists, words)

    def _load_pages(self, groups: Sequence[RowGroup]) -> tuple[Array, Array]:
        """Pages by column and row group, (columns, groups, NUM_PAGE_FIELDS) int64, and their decompressed bytes."""
        chunks = [group.footer.chunks(group.number) for group in groups]
        size = sum(group.footer.size(group.number) for group in groups)
        data = self._memory.empty(size + kernels.SPARE, np.uint8)
        pages = np.zeros((len(self._columns), len(groups), kernels.NUM_PAGE_FIELDS), np.int64)
        end = 0
        for index, (group, positions) in enumerate(zip(groups, chunks, strict=True)):
            end = kernels.load_pages(group.content, group.base, positions, pages, index, data, end)
        contents, target = [group.content.data for group in groups], data.data
        columns, indices = np.nonzero(pages[:, :, kernels.STORED_END] > 0)
        places = pages[columns[:, None], indices[:, None], _POSITIONS].tolist()
        for column, index, (start, stop, first, last) in zip(columns.tolist(), indices.tolist(), places, strict=True):
            if not self._decompress(contents[index][first:last], target[start:stop]):
                pages[column, index, kernels.START] = kernels.DAMAGED
        self._require(pages[:, :, kernels.START] != kernels.DAMAGED)
        data.flags.writeable = False  # like mapped files: kernels are compiled for each kind of array
        return pages, data

    def _decompress(self, stored: memoryview, target: memoryview) -> bool:
        """Decompress a zstd page; returns whether it fills the target exactly."""
        try:
            # Compared first, because readinto would truncate a longer page.
            size = zstandard.frame_content_size(stored)
            return size == len(target) == self._zstd.stream_reader(stored).readinto(target)
        except zstandard.ZstdError:
            return False

    def _read_levels(self, pages: Array, data: Array, num_rows: int) -> tuple[list[_Pages], list[ColumnType]]:
        """Lengths and offsets of the columns that the kernels know, and the columns that are left to Arrow."""
        lists = self._memory.empty((2, len(pages), num_rows + 1), np.int32)
        found = np.empty((2, len(pages)), np.int64)
        read_levels(data, pages, self._shapes, lists, found)
        self._require((found[0] == num_rows) | (found[0] == UNKNOWN))
        known: list[_Pages] = []
        others: list[ColumnType] = []
        for index, (column, rows, count) in enumerate(zip(self._columns, *found.tolist(), strict=True)):
            if rows == UNKNOWN:
                others.append(column)
            else:
                known.append(_Pages(column, pages[index], lists[0, index, :-1], lists[1, index], count))
        return known, others

    def _numbers(self, column: _Pages, data: Array) -> Array:
        """Numbers or truth values; int8 where a truth value may be null."""
        declared = column.column
        if declared.element == "bool":
            values = self._memory.empty(column.num_values, np.int8)
            is_complete = kernels.read_bits(data, column.pages, values)
            values = values if declared.nullable and not declared.is_list else values.view(np.bool_)
        else:
            values = self._memory.empty(column.num_values, declared.element)
            is_complete = kernels.read_words(data, column.pages, values.view(np.uint32))
        return _complete(column, values, is_complete)

    def _require(self, is_valid: Array) -> None:
        """Raise for the first column with a False, in any of its pages."""
        if not is_valid.all():
            raise _Damaged(f"column {self._columns[np.argwhere(~is_valid)[0, 0]].name} is damaged")


def _indices(column: _Pages, data: Array) -> tuple[list[str], Array]:
    """The union of all pages' dictionaries, and the index of each value in it."""
    positions: dict[str, int] = {}
    known: dict[bytes, list[int]] = {}
    codes, values = [], np.empty(column.num_values, np.int32)
    for page in column.pages:
        stored = data[page[kernels.WORDS_START] : page[kernels.WORDS_END]].tobytes()
        if stored not in known:
            known[stored] = [positions.setdefault(word, len(positions)) for word in _words(stored)]
        page[kernels.NUM_WORDS] = len(known[stored])
        codes += known[stored]
    is_complete = kernels.read_indices(data, column.pages, np.array(codes, np.int32), values)
    return list(positions), _complete(column, values, is_complete)


@lru_cache(1024)
def _words(page: bytes) -> tuple[str, ...]:
    """Words of a dictionary page, in PLAIN encoding."""
    words, position = [], 0
    try:
        while position < len(page):
            (size,) = struct.unpack_from("<I", page, position)
            words.append(page[position + 4 : position + 4 + size].decode())
            position += 4 + size
    except (struct.error, UnicodeDecodeError) as error:
        raise _Damaged("a dictionary is damaged") from error
    return tuple(words)


def _texts(columns: Sequence[_Pages], data: Array) -> list[Array]:
    """Values of string columns, (n,) str each; all strings are created in one Arrow call."""
    if not columns:
        return []
    ends = list(accumulate(column.num_values for column in columns))
    size = sum(int((column.pages[:, kernels.END] - column.pages[:, kernels.VALUES]).sum()) for column in columns)
    offsets, text = np.zeros(ends[-1] + 1, np.int64), np.empty(size, np.uint8)
    for column, end in zip(columns, ends, strict=True):
        first = end - column.num_values
        _complete(column, offsets, kernels.read_texts(data, column.pages, offsets[first:], text))
    buffers = [None, pa.py_buffer(offsets), pa.py_buffer(text)]
    array = pa.Array.from_buffers(pa.large_string(), ends[-1], buffers)
    try:
        strings: Array = array.to_numpy(zero_copy_only=False)
    except (UnicodeDecodeError, pa.ArrowException) as error:
        raise _Damaged("a text is damaged") from error
    return [strings[end - column.num_values : end] for column, end in zip(columns, ends, strict=True)]


def _complete(column: _Pages, values: Array, is_complete: bool) -> Array:
    if not is_complete:
        raise _Damaged(f"column {column.column.name} is damaged")
    return values


def _with_nulls(column: _Pages, values: Array) -> Array:
    """One value per row: the values of rows that have one, else the null value of the type."""
    if len(values) == len(column.lengths):
        return values
    rows: Array = np.full(len(column.lengths), _NULLS[column.column.element], values.dtype)
    rows[column.lengths > 0] = values
    return rows


def _read_by_arrow(groups: Sequence[RowGroup], columns: Sequence[ColumnType]) -> Columns:
    """Read columns with Arrow; consecutive row groups in the same bytes are read in one call."""
    tables = []
    for _, run in groupby(groups, key=lambda group: (id(group.footer), id(group.content))):
        together = list(run)
        footer = together[0].footer
        names = [column.name for column in columns if column.name not in footer.missing]
        names = names or [name for name in footer.names if name not in footer.missing][:1]  # for the number of rows
        _check_pages(together, names)
        try:
            file = together[0].open()
            tables.append(file.read_row_groups([group.number for group in together], names, use_threads=False))
        except (OSError, pa.ArrowException) as error:
            raise UnreadableFile(footer.url, str(error)) from error
    return Columns.from_arrow(pa.concat_tables(tables, promote_options="default"), columns)


def _check_pages(groups: Sequence[RowGroup], names: Sequence[str]) -> None:
    """Check the page headers of columns before Arrow reads them."""
    for group in groups:
        chunks = dict(zip(group.footer.names, group.footer.chunks(group.number).tolist(), strict=True))
        for name in names:
            try:
                check_pages(group.content, group.base, chunks[name])
            except Malformed as error:
                raise UnreadableFile(group.footer.url, f"column {name}: {error}") from error
