"""Decode columns of many row groups as NumPy arrays.

Arrow takes 5-10 us to set up a column of a row group, 30 us with zstd, and decodes the same list lengths for each
column; a scenario has 40 columns. Here a row group is two calls of kernels: one decompresses its pages, which stay in
the processor's cache until the other has decoded all columns. The kernels know what our writer produces; other
encodings (several pages, data pages of version 2, other codecs) are decoded by Arrow, and so are the first row groups
of a process, because the kernels take seconds to compile where they are not cached.
"""

from __future__ import annotations

import struct
from collections.abc import Sequence
from functools import lru_cache
from itertools import chain

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import zstandard

from scenarionet_data.arrays.columns import Columns, ColumnType, Lists
from scenarionet_data.arrays.compiled import unchecked
from scenarionet_data.arrays.dtypes import Array
from scenarionet_data.arrays.memory import Memory
from scenarionet_data.storage.read.parquet import page_kernels as pages
from scenarionet_data.storage.read.parquet import value_kernels as values
from scenarionet_data.storage.read.parquet.arrow_columns import read_by_arrow
from scenarionet_data.storage.read.parquet.footer import Footer, RowGroup, UnreadableFile
from scenarionet_data.storage.read.parquet.thrift_kernels import UNKNOWN

COMPILE_AFTER = 64
"""Row groups that a reader leaves to Arrow before it compiles the kernels: compiling costs as much as 1,500."""
_TEXT = ("string", "json")
_NULLS = {"float32": np.float32(np.nan), "bool": np.int8(-1), "dictionary": np.int32(-1), **dict.fromkeys(_TEXT)}
_KINDS = {"bool": values.BITS, "dictionary": values.INDICES, **dict.fromkeys(_TEXT, values.TEXTS)}
_POSITIONS = [pages.START, pages.END, pages.STORED, pages.STORED_END]


class _Damaged(Exception):
    """The bytes of a column are damaged."""


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
        self._texts = [place for place, column in enumerate(self._columns) if column.element in _TEXT]
        self._dictionaries = [place for place, column in enumerate(self._columns) if column.element == "dictionary"]
        self._plan = np.array([_described(column) for column in self._columns], np.int64)
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
        if self._left_to_arrow > 0 and not pages.is_compiled():
            self._left_to_arrow -= len(groups)
            return read_by_arrow(groups, self._columns)
        try:
            return self._read(groups)
        except _Damaged as error:
            if len(groups) > 1:
                for group in groups:  # raises for the damaged one
                    self.read([group])
            raise UnreadableFile(groups[0].footer.url, str(error)) from error

    def _read(self, groups: Sequence[RowGroup]) -> Columns:
        plan, out = self._reserved(groups)
        scratch = self._memory.empty(max(group.footer.size(group.number) for group in groups) + pages.SPARE, np.uint8)
        found = np.zeros((len(groups), len(self._columns), pages.NUM_PAGE_FIELDS), np.int64)
        counts = np.zeros((len(groups) + 1, len(self._columns)), np.int64)
        row, dictionaries, decode = 0, [], unchecked(values.decode_pages)
        for index, group in enumerate(groups):
            self._load_pages(group, found[index], scratch)
            dictionaries.append([_dictionary(found[index, place], scratch) for place in self._dictionaries])
            damaged = decode(scratch, found[index], plan, row, group.num_rows, out)
            if damaged >= 0:
                raise self._damaged(damaged)
            row += group.num_rows
            counts[index + 1] = out.counts
        return self._columns_of(groups, plan, out, counts, dictionaries)

    def _reserved(self, groups: Sequence[RowGroup]) -> tuple[Array, values.Decoded]:
        """The columns with places for their values, and memory for these."""
        chunks = [group.footer.chunks(group.number) for group in groups]
        total = chunks[0] if len(chunks) == 1 else np.sum(chunks, axis=0)
        plan, empty = self._plan.copy(), self._memory.empty
        num_words, num_bits, num_texts, size = unchecked(values.reserve)(total, plan)
        ends = empty(num_texts + 1, np.int64)
        ends[0] = 0
        return plan, values.Decoded(
            empty((2, len(plan), sum(group.num_rows for group in groups) + 1), np.int32),
            np.zeros(len(plan), np.int64),
            empty(num_words, np.uint32),
            empty(num_bits, np.int8),
            ends,
            empty(size, np.uint8),
            np.zeros(1, np.int64),
        )

    def _load_pages(self, group: RowGroup, found: Array, scratch: Array) -> None:
        """Locate the pages of a row group in ``found``, and decompress them into ``scratch``."""
        chunks = group.footer.chunks(group.number)
        stored = unchecked(pages.load_pages)(group.content, group.base, chunks, found, scratch)
        if stored > 0:  # in files of earlier versions
            columns = np.flatnonzero(found[:, pages.STORED_END] > 0)
            content, target = group.content.data, scratch.data
            places = found[columns[:, None], _POSITIONS].tolist()
            for column, (start, stop, first, last) in zip(columns.tolist(), places, strict=True):
                if not self._decompress(content[first:last], target[start:stop]):
                    raise self._damaged(column)
        if stored < 0:
            raise self._damaged(int(np.argmax(found[:, pages.START] == pages.DAMAGED)))

    def _decompress(self, stored: memoryview, target: memoryview) -> bool:
        """Decompress a zstd page; returns whether it fills the target exactly."""
        try:
            # Compared first, because readinto would truncate a longer page.
            size = zstandard.frame_content_size(stored)
            return size == len(target) == self._zstd.stream_reader(stored).readinto(target)
        except zstandard.ZstdError:
            return False

    def _columns_of(
        self,
        groups: Sequence[RowGroup],
        plan: Array,
        out: values.Decoded,
        counts: Array,
        dictionaries: Sequence[Sequence[Sequence[str]]],
    ) -> Columns:
        """The decoded columns, and those that are left to Arrow.

        Args:
            groups: The row groups.
            plan: Places of the values.
            out: The values.
            counts: (1 + groups, columns) number of values before each row group, and of all.
            dictionaries: Words of each row group's dictionary columns.
        """
        flat: dict[str, Array] = {}
        lists: dict[str, Lists] = {}
        words: dict[str, Sequence[str]] = {}
        others: list[ColumnType] = []
        texts = self._strings(out, counts)
        numbers = {"float32": out.words.view(np.float32), "int32": out.words.view(np.int32), "bool": out.bits}
        firsts, ends = plan[:, values.FIRST].tolist(), counts[-1].tolist()
        rows = zip(self._columns, firsts, ends, out.lists[0, :, :-1], out.lists[1], strict=True)
        for place, (column, first, count, lengths, offsets) in enumerate(rows):
            name, element = column.name, column.element
            if count == UNKNOWN:
                others.append(column)
                continue
            if element in _TEXT:
                found = texts[place]
            elif element == "dictionary":
                found = numbers["int32"][first : first + count]
                number = self._dictionaries.index(place)
                words[name] = _joined([each[number] for each in dictionaries], found, counts[:, place])
            else:
                found = numbers[element][first : first + count]
            if column.is_list:
                lists[name] = Lists(lengths, offsets, found.view(np.bool_) if element == "bool" else found)
            else:
                found = found.view(np.bool_) if element == "bool" and not column.nullable else found
                flat[name] = _with_nulls(column, lengths, found)
        if others:
            read = read_by_arrow(groups, others)
            flat, lists, words = flat | {**read.flat}, lists | {**read.lists}, words | {**read.words}
        return Columns(out.lists.shape[2] - 1, flat, lists, words)

    def _strings(self, out: values.Decoded, counts: Array) -> dict[int, Array]:
        """Values of text columns, (n,) str each, by place; all are created in one Arrow call."""
        num_texts = int(out.num_texts[0])
        if not self._texts:
            return {}
        buffers = [None, pa.py_buffer(out.ends[: num_texts + 1]), pa.py_buffer(out.text)]
        array = pa.Array.from_buffers(pa.large_string(), num_texts, buffers)
        try:
            strings: Array = array.to_numpy(zero_copy_only=False)
        except (UnicodeDecodeError, pa.ArrowException) as error:
            raise _Damaged("a text is damaged") from error
        if len(counts) == 2:
            ends = np.cumsum(np.maximum(counts[1, self._texts], 0)).tolist()
            return {place: strings[first:end] for place, first, end in zip(self._texts, [0, *ends], ends, strict=False)}
        lengths = np.maximum(np.diff(counts[:, self._texts], axis=0), 0)  # by row group, then by column
        owner = np.repeat(np.tile(self._texts, len(lengths)), lengths.ravel())
        return {place: strings[owner == place] for place in self._texts}

    def _damaged(self, column: int) -> _Damaged:
        return _Damaged(f"column {self._columns[column].name} is damaged")


def _described(column: ColumnType) -> tuple[int, ...]:
    """A column as numbers, see ``value_kernels``."""
    shape = pages.LIST * column.is_list + pages.NULLABLE * column.nullable
    return shape, _KINDS.get(column.element, values.WORDS), 0, 0


def _dictionary(page: Array, data: Array) -> Sequence[str]:
    """The words of a page's dictionary."""
    words = _words(data[page[pages.WORDS_START] : page[pages.WORDS_END]].tobytes())
    page[pages.NUM_WORDS] = len(words)
    return words


def _joined(dictionaries: Sequence[Sequence[str]], indices: Array, counts: Array) -> list[str]:
    """The words of all row groups; indices of each one's words become those of all."""
    if len(dictionaries) > 1:
        starts = np.cumsum([0, *map(len, dictionaries[:-1])], dtype=np.int32)
        indices += np.repeat(starts, np.diff(counts))
    return list(chain.from_iterable(dictionaries))


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


def _with_nulls(column: ColumnType, lengths: Array, found: Array) -> Array:
    """One value per row: the values of rows that have one, else the null value of the type."""
    if len(found) == len(lengths):
        return found
    rows: Array = np.full(len(lengths), _NULLS[column.element], found.dtype)
    rows[lengths > 0] = found
    return rows
