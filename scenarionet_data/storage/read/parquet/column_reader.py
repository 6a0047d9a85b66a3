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

import numpy as np
import pyarrow.parquet as pq
import zstandard

from scenarionet_data.arrays.columns import ColumnBlock, ColumnLayout, Columns
from scenarionet_data.arrays.compiled import unchecked
from scenarionet_data.arrays.dtypes import Array
from scenarionet_data.arrays.memory import Memory
from scenarionet_data.storage.read.parquet import page_kernels as pages
from scenarionet_data.storage.read.parquet import value_kernels as values
from scenarionet_data.storage.read.parquet.arrow_columns import read_by_arrow
from scenarionet_data.storage.read.parquet.footer import Footer, RowGroup, UnreadableFile
from scenarionet_data.storage.read.parquet.row_group_kernels import (
    decode_stored_pages,
    is_compiled,
    read_row_group,
    reserve,
)
from scenarionet_data.storage.read.parquet.thrift_kernels import UNKNOWN

COMPILE_AFTER = 64
"""Row groups that a reader leaves to Arrow before it compiles the kernels: compiling costs as much as 1,500."""
_POSITIONS = [pages.START, pages.END, pages.STORED, pages.STORED_END]


class _Damaged(Exception):
    """The bytes of a column are damaged."""


class ColumnReader:
    """Reads columns of one table; for one thread.

    Args:
        layout: The columns.
        memory: Memory for pages and values; of its own by default.
        compile_after: Row groups that are left to Arrow unless the kernels are compiled already.
    """

    def __init__(self, layout: ColumnLayout, memory: Memory | None = None, compile_after: int = COMPILE_AFTER) -> None:
        self._layout = layout
        self._plan = np.zeros((len(layout.columns), values.NUM_COLUMN_FIELDS), np.int64)
        self._plan[:, values.SHAPE] = [pages.LIST * c.is_list + pages.NULLABLE * c.nullable for c in layout.columns]
        self._plan[:, values.KIND] = layout.kinds
        self._dictionaries = [(c.name, place) for place, c in enumerate(layout.columns) if c.element == "dictionary"]
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
        return Footer(url, metadata, self._layout.columns, has_checksums)

    def read(self, groups: Sequence[RowGroup]) -> Columns:
        """Rows of some row groups, concatenated.

        Raises:
            UnreadableFile: A page is damaged.
        """
        if self._left_to_arrow > 0 and not is_compiled():
            self._left_to_arrow -= len(groups)
            return read_by_arrow(groups, self._layout)
        try:
            found = self._read(groups)
        except _Damaged as error:
            if len(groups) > 1:
                for group in groups:  # raises for the damaged one
                    self.read([group])
            raise UnreadableFile(groups[0].footer.url, str(error)) from error
        return read_by_arrow(groups, self._layout) if found is None else found

    def _read(self, groups: Sequence[RowGroup]) -> Columns | None:
        """Read with the kernels; None if there is something that they do not know."""
        needed = [group.footer.memory(group.number) for group in groups]
        if (0, 0) in needed:
            return None
        empty, count = self._memory.empty, len(self._layout.columns)
        scratch = empty(max(size for size, _ in needed), np.uint8)
        levels = empty((4, max(size for _, size in needed)), np.uint8)
        plan, out = self._reserved(groups)
        row, dictionaries = 0, _Dictionaries(self._dictionaries, out)
        for group in groups:
            found = np.zeros((count, pages.NUM_PAGE_FIELDS), np.int64)
            chunks, num_rows = group.footer.chunks(group.number), group.num_rows
            done = unchecked(read_row_group)(
                group.content, group.base, chunks, scratch, levels, found, plan, row, num_rows, out
            )
            if done > count:
                self._decompress(group, found, scratch)
                done = unchecked(decode_stored_pages)(scratch, levels, found, plan, row, num_rows, out)
            if done == UNKNOWN:
                return None
            if done < count:
                raise self._damaged(done)
            dictionaries.add(found)
            row += num_rows
        return Columns(row, self._layout, out, dictionaries.words)

    def _reserved(self, groups: Sequence[RowGroup]) -> tuple[Array, ColumnBlock]:
        """The columns with places for their values, and memory for these."""
        chunks = [group.footer.chunks(group.number) for group in groups]
        total = chunks[0] if len(chunks) == 1 else np.sum(chunks, axis=0)
        plan, firsts, empty = self._plan.copy(), np.empty(len(self._plan), np.int64), self._memory.empty
        num_rows = sum(group.num_rows for group in groups)
        num_words, num_bits, num_ends, size = unchecked(reserve)(total, num_rows, plan, firsts)
        return plan, ColumnBlock(
            empty((2, len(plan), num_rows + 1), np.int32),
            firsts,
            np.zeros(len(plan), np.int64),
            empty(num_words, np.uint32),
            empty(num_bits, np.int8),
            empty(num_ends, np.int64),
            empty(size, np.uint8),
        )

    def _decompress(self, group: RowGroup, found: Array, scratch: Array) -> None:
        """Decompress the pages in zstd to their places."""
        columns = np.flatnonzero(found[:, pages.STORED_END] > 0)
        content, target = group.content.data, scratch.data
        places = found[columns[:, None], _POSITIONS].tolist()
        for column, (start, stop, first, last) in zip(columns.tolist(), places, strict=True):
            if not self._fills(content[first:last], target[start:stop]):
                raise self._damaged(column)

    def _fills(self, stored: memoryview, target: memoryview) -> bool:
        """Decompress a zstd page; returns whether it fills the target exactly."""
        try:
            # Compared first, because readinto would truncate a longer page.
            size = zstandard.frame_content_size(stored)
            return size == len(target) == self._zstd.stream_reader(stored).readinto(target)
        except zstandard.ZstdError:
            return False

    def _damaged(self, column: int) -> _Damaged:
        return _Damaged(f"column {self._layout.columns[column].name} is damaged")


class _Dictionaries:
    """The dictionaries of columns, joined over row groups.

    Args:
        columns: Names and places of the columns.
        out: The block; indices in the dictionary of a row group become those in all.
    """

    def __init__(self, columns: Sequence[tuple[str, int]], out: ColumnBlock) -> None:
        self._columns, self._out = columns, out
        self._starts = dict.fromkeys((place for _, place in columns), 0)
        self.words: dict[str, tuple[str, ...]] = {}

    def add(self, found: Array) -> None:
        """Add the dictionaries of a row group's pages."""
        for name, place in self._columns:
            first, size = found[place, pages.WORDS_PLACE], found[place, pages.WORDS_SIZE]
            words = _words(self._out.text[first : first + size].tobytes())
            start, end = self._starts[place], int(self._out.counts[place])
            known = self.words.setdefault(name, words)
            if known != words:
                at = self._out.firsts[place]
                indices = self._out.words[at + start : at + end].view(np.int32)
                indices[indices >= 0] += len(known)
                self.words[name] = known + words
            self._starts[place] = end


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
