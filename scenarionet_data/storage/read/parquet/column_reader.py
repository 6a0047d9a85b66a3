"""Decode columns of many row groups as NumPy arrays.

Arrow takes 5-10 us to set up a column of a row group, 30 us with zstd, and decodes the same list lengths for each
column; a scenario has 40 columns. Here a row group is one call of a kernel, which decodes a page as soon as it is
decompressed, or two with pages in zstd. The kernels know what our writer produces; row groups with anything else
(several pages, data pages of version 2, other codecs) are decoded by Arrow, and so are the first ones of a process,
because the kernels take seconds to compile where they are not cached.
"""

from __future__ import annotations

import struct
from collections.abc import Sequence
from functools import lru_cache

import numpy as np
import pyarrow.parquet as pq
import zstandard

from scenarionet_data.arrays.columns import FIRST, SIZE, ColumnBlock, ColumnLayout, Columns
from scenarionet_data.arrays.dtypes import Array
from scenarionet_data.arrays.memory import Memory
from scenarionet_data.compiled.checking import unchecked
from scenarionet_data.storage.read.parquet import page_kernels as pages
from scenarionet_data.storage.read.parquet.arrow_columns import read_by_arrow
from scenarionet_data.storage.read.parquet.footer import Footer, RowGroup, StoredGroup, UnreadableFile
from scenarionet_data.storage.read.parquet.reservation import Reservation
from scenarionet_data.storage.read.parquet.row_group_kernels import read_row_group
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
        self._dictionaries = [(c.name, place) for place, c in enumerate(layout.columns) if c.element == "dictionary"]
        self._zstd = zstandard.ZstdDecompressor()
        self._left_to_arrow = compile_after
        self._memory = memory or Memory()
        self._levels = np.empty((4, 0), np.uint8)
        self._pages = np.zeros((len(layout.columns), pages.NUM_PAGE_FIELDS), np.int64)

    def footer(self, url: str, metadata: pq.FileMetaData, digests: Sequence[bytes] = (), end: int = 0) -> Footer:
        """Locate the columns in a file.

        Args:
            url: The file, for errors.
            metadata: Its footer.
            digests: XXH3-128 of each row group, which are compared when they are read; empty if there are none.
            end: Where the last row group ends.

        Raises:
            UnreadableFile: A required column is missing.
        """
        return Footer(url, metadata, self._layout, digests, end)

    def read(self, groups: Sequence[RowGroup]) -> Columns:
        """Rows of some row groups, concatenated.

        Raises:
            UnreadableFile: A page is damaged.
        """
        for group in groups:
            group.verify()
        if self._left_to_arrow > 0:
            if not getattr(read_row_group, "signatures", True):
                self._left_to_arrow -= len(groups)
                return read_by_arrow(groups, self._layout)
            self._left_to_arrow = 0  # asking takes 5 us
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
        stored, largest, size = [], 0, 0
        for group in groups:
            each = group.footer.stored(group.number)
            if not each.can_decode:
                return None
            stored.append(each)
            largest, size = max(largest, each.largest), max(size, each.scratch)
        if largest > self._levels.shape[1]:
            self._levels = np.empty((4, largest), np.uint8)
        reserved = groups[0].footer.reserve(groups[0].number) if len(groups) == 1 else self._reserved(stored)
        scratch, levels, found = self._memory.scratch(size), self._levels, self._pages
        out, count, row = reserved.block(self._memory), len(found), 0
        words: dict[str, tuple[str, ...]] = {}
        for (_, _, content, base), (chunks, num_rows, *_) in zip(groups, stored, strict=True):
            done = unchecked(read_row_group)(content, base, chunks, scratch, levels, found, row, num_rows, out, False)
            if done > count:
                self._decompress(content, scratch)
                done = unchecked(read_row_group)(
                    content, base, chunks, scratch, levels, found, row, num_rows, out, True
                )
            if done == UNKNOWN:
                return None
            if done < count:
                raise self._damaged(done)
            self._add_words(row, num_rows, out, words)
            row += num_rows
        return Columns(row, self._layout, out, words)

    def _reserved(self, stored: Sequence[StoredGroup]) -> Reservation:
        """Places in memory of the values of several row groups."""
        chunks = np.sum([each.chunks for each in stored], axis=0)
        return Reservation.of(self._layout, chunks, sum([each.num_rows for each in stored]))

    def _decompress(self, content: Array, scratch: Array) -> None:
        """Decompress the pages in zstd to their places."""
        for column in np.flatnonzero(self._pages[:, pages.STORED_END]).tolist():
            start, stop, first, last = self._pages[column, _POSITIONS].tolist()
            if not self._fills(content.data[first:last], scratch.data[start:stop]):
                raise self._damaged(column)

    def _fills(self, stored: memoryview, target: memoryview) -> bool:
        """Decompress a zstd page; returns whether it fills the target exactly."""
        try:
            if zstandard.frame_content_size(stored) != len(target):
                return False
            target[:] = self._zstd.decompress(stored)
        except zstandard.ZstdError:
            return False
        return True

    def _add_words(self, row: int, num_rows: int, out: ColumnBlock, words: dict[str, tuple[str, ...]]) -> None:
        """Add the dictionaries of a row group's pages; its indices become those in all words.

        Args:
            row: First row of the row group.
            num_rows: Its number of rows.
            out: The values, those of the row group last.
            words: Words of each column, extended.
        """
        found = self._pages
        for name, place in self._dictionaries:
            first, size = found.item(place, pages.WORDS_PLACE), found.item(place, pages.WORDS_SIZE)
            added = _words(out.memory[first : first + size].tobytes())
            if not row:
                words[name] = added
            elif words[name] != added:
                known = words[name]
                end = out.columns.item(place, FIRST) + out.columns.item(place, SIZE)
                start = end - (found.item(place, pages.COUNT) if self._layout.are_lists[place] else num_rows)
                indices = out.memory[4 * start : 4 * end].view(np.int32)
                indices[indices >= 0] += len(known)
                words[name] = known + added

    def _damaged(self, column: int) -> _Damaged:
        return _Damaged(f"column {self._layout.columns[column].name} is damaged")


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
