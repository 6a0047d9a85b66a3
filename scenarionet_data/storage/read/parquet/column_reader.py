"""Decode columns of many row groups as NumPy arrays.

Arrow takes 5-10 us to set up a column of a row group, 30 us with zstd, and decodes the same list lengths for each
column; a scenario has 40 columns. Here a row group is one call of a kernel, which decodes a page as soon as it is
decompressed, or two with pages in zstd. The kernels know what our writer produces; row groups with anything else
(several pages, data pages of version 2, other codecs) are decoded by Arrow, and so are the first ones of a process,
because the kernels take seconds to compile where they are not cached.
"""

from __future__ import annotations

import io
import struct
from collections.abc import Sequence
from functools import lru_cache
from operator import itemgetter

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import zstandard
from xxhash import xxh3_128_digest

from scenarionet_data.arrays.columns import FIRST, SIZE, ColumnBlock, ColumnLayout, Columns, from_arrow
from scenarionet_data.arrays.dtypes import Array
from scenarionet_data.arrays.memory import Memory
from scenarionet_data.compiled.checking import unchecked
from scenarionet_data.storage.read.parquet import page_kernels as pages
from scenarionet_data.storage.read.parquet.footer import Reservation, RowGroup, UnreadableFile
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

    Attributes:
        layout: The same columns.
    """

    def __init__(self, layout: ColumnLayout, memory: Memory | None = None, compile_after: int = COMPILE_AFTER) -> None:
        self.layout = layout
        self._dictionaries = [column.name for column in layout.columns if column.element == "dictionary"]
        self._zstd = zstandard.ZstdDecompressor()
        self._left_to_arrow = compile_after
        self._memory = memory or Memory()
        self._levels = np.empty((4, 0), np.uint8)
        self._pages = np.zeros((len(layout.columns), pages.NUM_PAGE_FIELDS), np.int64)

    def read(self, groups: Sequence[RowGroup]) -> Columns:
        """Rows of some row groups, concatenated.

        Raises:
            UnreadableFile: A page is damaged.
        """
        for footer, number, content, base in groups:
            if footer.digests:
                start, end = footer.stored(number).span
                if xxh3_128_digest(content.data[start - base : end - base]) != footer.digests[number]:
                    raise UnreadableFile(footer.url, "its bytes differ from those that were written")
        if self._left_to_arrow > 0:
            if not getattr(read_row_group, "signatures", True):
                self._left_to_arrow -= len(groups)
                return read_by_arrow(groups, self.layout)
            self._left_to_arrow = 0  # asking takes 5 us
        try:
            found = self._read(groups)
        except _Damaged as error:
            if len(groups) > 1:
                for group in groups:  # raises for the damaged one
                    self.read([group])
            raise UnreadableFile(groups[0].footer.url, str(error)) from error
        return read_by_arrow(groups, self.layout) if found is None else found

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
        if len(groups) == 1:
            reserved = groups[0].footer.reserve(groups[0].number)
        else:
            chunks = np.sum([each.chunks for each in stored], axis=0)
            reserved = Reservation.of(self.layout, chunks, sum([each.num_rows for each in stored]))
        scratch, found = self._memory.scratch(size), self._pages
        memory = scratch, self._levels
        out, count, row = reserved.block(self._memory), len(found), 0
        words: dict[str, tuple[str, ...]] = {}
        for (_, _, content, base), (chunks, num_rows, *_) in zip(groups, stored, strict=True):
            done = unchecked(read_row_group)(content, base, chunks, memory, found, (row, num_rows), out, False)
            if done > count:
                self._decompress(content, scratch)
                done = unchecked(read_row_group)(content, base, chunks, memory, found, (row, num_rows), out, True)
            if done == UNKNOWN:
                return None
            if done < count:
                raise self._damaged(done)
            self._add_words(row, num_rows, out, words)
            row += num_rows
        return Columns(row, self.layout, out, words)

    def _decompress(self, content: Array, scratch: Array) -> None:
        """Decompress the pages in zstd to their places."""
        held, memory, decompress = content.data, scratch.data, self._zstd.decompress
        columns = np.flatnonzero(self._pages[:, pages.STORED_END])
        places = self._pages[columns[:, None], _POSITIONS].tolist()  # at once: a tenth of the time
        for column, (start, stop, first, last) in zip(columns.tolist(), places, strict=True):
            stored = held[first:last]
            try:
                if zstandard.frame_content_size(stored) != stop - start:
                    raise self._damaged(column)
                memory[start:stop] = decompress(stored)
            except zstandard.ZstdError as error:
                raise self._damaged(column) from error

    def _add_words(self, row: int, num_rows: int, out: ColumnBlock, words: dict[str, tuple[str, ...]]) -> None:
        """Add the dictionaries of a row group's pages; its indices become those in all words.

        Args:
            row: First row of the row group.
            num_rows: Its number of rows.
            out: The values, those of the row group last.
            words: Words of each column, extended.
        """
        found = self._pages
        for name in self._dictionaries:
            place = self.layout.place(name)
            first, size = found.item(place, pages.WORDS_PLACE), found.item(place, pages.WORDS_SIZE)
            added = _words(out.memory[first : first + size].tobytes())
            if not row:
                words[name] = added
            elif words[name] != added:
                known = words[name]
                end = out.columns.item(place, FIRST) + out.columns.item(place, SIZE)
                start = end - (found.item(place, pages.COUNT) if self.layout.are_lists[place] else num_rows)
                indices = out.memory[4 * start : 4 * end].view(np.int32)
                indices[indices >= 0] += len(known)
                words[name] = known + added

    def _damaged(self, column: int) -> _Damaged:
        return _Damaged(f"column {self.layout.columns[column].name} is damaged")


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


def read_by_arrow(groups: Sequence[RowGroup], layout: ColumnLayout) -> Columns:
    """Read columns with Arrow, in any encoding; consecutive row groups in the same bytes are read in one call.

    Raises:
        UnreadableFile: A page is damaged.
    """
    runs: list[list[RowGroup]] = []
    for group in groups:
        if runs and runs[-1][0].footer is group.footer and runs[-1][0].content is group.content:
            runs[-1].append(group)
        else:
            runs.append([group])
    tables = []
    for run in runs:
        footer, _, content, base = run[0]
        try:
            source = pa.PythonFile(_Window(content, base), "r") if base else pa.BufferReader(content)
            file = pq.ParquetFile(source, metadata=footer.metadata, pre_buffer=False)
            numbers = list(map(itemgetter(1), run))
            tables.append(file.read_row_groups(numbers, footer.present, use_threads=False))
            tables[-1].validate(full=True)  # texts are UTF-8
        except (OSError, pa.ArrowException) as error:
            raise UnreadableFile(footer.url, str(error)) from error
    return from_arrow(pa.concat_tables(tables, promote_options="default"), layout)


class _Window(io.RawIOBase):
    """A file of which only a range of bytes is in memory, for Arrow."""

    def __init__(self, content: Array, base: int) -> None:
        self._content, self._base = content, base
        self._position = 0

    def readable(self) -> bool:
        """Always True; required by io.RawIOBase."""
        return True

    def seekable(self) -> bool:
        """Always True; required by io.RawIOBase."""
        return True

    def tell(self) -> int:
        """Current position in the file."""
        return self._position

    def seek(self, offset: int, whence: int = io.SEEK_SET) -> int:
        """Change the position; the end of the file is the end of the range."""
        end = self._base + len(self._content)
        self._position = offset + {io.SEEK_SET: 0, io.SEEK_CUR: self._position, io.SEEK_END: end}[whence]
        return self._position

    def read(self, size: int = -1) -> bytes:
        """Read bytes at the current position."""
        start = self._position - self._base
        if start < 0 or size < 0 or start + size > len(self._content):
            raise OSError("a column chunk exceeds its row group")
        self._position += size
        return bytes(self._content[start : start + size])
