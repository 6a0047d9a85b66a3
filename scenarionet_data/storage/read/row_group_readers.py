"""Who reads row groups of a lake's files: from files on this machine, or by byte ranges from an object store."""

from __future__ import annotations

import io
import mmap
from collections import OrderedDict
from collections.abc import Collection, Iterable, Mapping, Sequence
from concurrent.futures import Future
from dataclasses import dataclass
from functools import cached_property
from itertools import accumulate
from pathlib import Path
from typing import Protocol

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from scenarionet_data.arrays.dtypes import Array
from scenarionet_data.codec import Rows
from scenarionet_data.schema import tables
from scenarionet_data.storage.files.errors import reading
from scenarionet_data.storage.files.lake_files import LakeFiles
from scenarionet_data.storage.files.remote import RemoteLakeFiles
from scenarionet_data.storage.read.parquet.column_reader import ColumnReader
from scenarionet_data.storage.read.parquet.row_groups import Footer, RowGroup

_OPEN_FILES = 32
_KEPT_FOOTERS = 512
_MOST_COMING = 1024
_GAP = 2**20
"""Bytes between two row groups that are rather read than left out: they cost less than a request."""

Address = tuple[str, str, int]
"""Table, file and number of a row group."""

Span = tuple[int, int, Address]
"""Where the bytes of a row group begin and end in its file."""


class RowGroupReader(Protocol):
    """Reads row groups of many files; for one thread."""

    def fetch(self, addresses: Iterable[Address]) -> None:
        """Have row groups at hand that are read next."""

    def read(self, addresses: Sequence[Address]) -> Rows:
        """Rows of some row groups of one table, one after the other.

        Raises:
            LakeError: A file is gone or damaged; the message names it.
            SchemaMismatch: A file is of another version of the table.
        """


def open_reader(files: LakeFiles, columns: Mapping[str, Sequence[str]]) -> RowGroupReader:
    """A reader of a lake's row groups.

    Args:
        files: The lake.
        columns: Names of the columns to read, by table.
    """
    return RangeReader(files, columns) if isinstance(files, RemoteLakeFiles) else FileReader(files, columns)


class _Tables:
    """The tables whose columns are read."""

    def __init__(self, columns: Mapping[str, Sequence[str]]) -> None:
        self._columns = columns
        self._readers = {name: ColumnReader(tables.load(name), columns[name]) for name in columns}

    def footer(self, table: str, metadata: pq.FileMetaData, url: str) -> Footer:
        """What is known of a file from its footer."""
        declared = tables.load(table)
        declared.check_version(metadata.metadata, url)
        return Footer(metadata, declared, self._columns[table])

    def read(self, table: str, groups: Sequence[RowGroup]) -> Rows:
        """Rows of some row groups, one after the other."""
        return Rows(self._readers[table].read(groups), [0, *accumulate(group.num_rows for group in groups)])


class _OpenFile:
    """A file on this machine."""

    def __init__(self, path: Path, table: str, known: _Tables) -> None:
        self._path = path
        with reading(path):
            self.footer = known.footer(table, pq.read_metadata(path, memory_map=True), str(path))
            with path.open("rb") as file:
                self.content = np.frombuffer(mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ), np.uint8)

    @cached_property
    def by_arrow(self) -> pq.ParquetFile:
        """The file as Arrow reads it."""
        # pre_buffer would share its cache between threads; a memory map needs no copy.
        return pq.ParquetFile(self._path, metadata=self.footer.metadata, memory_map=True, pre_buffer=False)

    def row_group(self, number: int) -> RowGroup:
        """One of its row groups."""
        return RowGroup(str(self._path), self.footer, number, self.content, 0, lambda: self.by_arrow)


class FileReader:
    """Reads files on this machine, the least recently used of many closed."""

    def __init__(self, files: LakeFiles, columns: Mapping[str, Sequence[str]]) -> None:
        self._files = files
        self._tables = _Tables(columns)
        self._open: OrderedDict[str, _OpenFile] = OrderedDict()

    def fetch(self, addresses: Iterable[Address]) -> None:
        """Nothing: files are mapped."""

    def read(self, addresses: Sequence[Address]) -> Rows:
        """Rows of some row groups of one table, one after the other."""
        return self._tables.read(addresses[0][0], [self._row_group(*address) for address in addresses])

    def _row_group(self, table: str, name: str, number: int) -> RowGroup:
        opened = self._open.get(name)
        if opened is None:
            opened = self._open[name] = _OpenFile(self._files.path(name), table, self._tables)
            if len(self._open) > _OPEN_FILES:
                self._open.popitem(last=False)
        self._open.move_to_end(name)
        return opened.row_group(number)


@dataclass(frozen=True)
class _Coming:
    """A row group on its way: ``start`` is where in its file the bytes begin that were asked for."""

    start: int
    answer: Future[memoryview]


class _Window(io.RawIOBase):
    """A file of which only some bytes are here."""

    def __init__(self, content: Array, base: int, size: int) -> None:
        self._content, self._base, self._size = content, base, size
        self._at = 0

    def readable(self) -> bool:
        """It is."""
        return True

    def seekable(self) -> bool:
        """It is."""
        return True

    def tell(self) -> int:
        """Where it stands."""
        return self._at

    def seek(self, offset: int, whence: int = io.SEEK_SET) -> int:
        """Go elsewhere."""
        self._at = offset + {io.SEEK_SET: 0, io.SEEK_CUR: self._at, io.SEEK_END: self._size}[whence]
        return self._at

    def read(self, size: int = -1) -> bytes:
        """The next bytes."""
        start = self._at - self._base
        if start < 0 or size < 0 or start + size > len(self._content):
            raise OSError("bytes of the file are not at hand")
        self._at += size
        return bytes(self._content[start : start + size])


class RangeReader:
    """Reads row groups by byte ranges: one request for each, fewer where they lie side by side.

    Footers are kept, in memory and as copies on this machine. What is fetched comes while others are read.
    """

    def __init__(self, files: RemoteLakeFiles, columns: Mapping[str, Sequence[str]]) -> None:
        self._files = files
        self._tables = _Tables(columns)
        self._footers: OrderedDict[str, tuple[int, Footer]] = OrderedDict()
        self._coming: OrderedDict[Address, _Coming] = OrderedDict()

    def fetch(self, addresses: Iterable[Address]) -> None:
        """Ask for row groups, all at once, and first for what is read first."""
        wanted = dict.fromkeys(address for address in addresses if address not in self._coming)
        missing = {address: place for place, address in enumerate(wanted)}
        if not missing:
            return
        self._learn(missing)
        runs = _runs((*self._footers[address[1]][1].span(address[2]), address) for address in missing)
        for run in sorted(runs, key=lambda run: min(missing[address] for _, _, address in run)):
            (first, _, (_, name, _)), last = run[0], run[-1][1]
            answer = self._files.submit(self._files.range, name, first, last)
            self._coming.update((address, _Coming(first, answer)) for _, _, address in run)
        while len(self._coming) > max(_MOST_COMING, len(missing)):  # nobody has read them
            self._coming.popitem(last=False)

    def read(self, addresses: Sequence[Address]) -> Rows:
        """Rows of some row groups of one table, one after the other."""
        self.fetch(addresses)
        self._learn(addresses)
        return self._tables.read(addresses[0][0], [self._row_group(address) for address in addresses])

    def _row_group(self, address: Address) -> RowGroup:
        """A row group, once it is here."""
        (_, name, number), coming = address, self._coming.pop(address)
        size, footer = self._footers[name]
        content = np.frombuffer(coming.answer.result(), np.uint8)

        def opened() -> pq.ParquetFile:
            window = pa.PythonFile(_Window(content, coming.start, size), "r")
            return pq.ParquetFile(window, metadata=footer.metadata, pre_buffer=False)

        return RowGroup(self._files.url(name), footer, number, content, coming.start, opened)

    def _learn(self, addresses: Collection[Address]) -> None:
        """Read the footers of files that are not known yet."""
        unknown = sorted({(table, name) for table, name, _ in addresses if name not in self._footers})
        for (table, name), (size, end) in zip(
            unknown, self._files.map(self._files.end, [name for _, name in unknown]), strict=True
        ):
            with reading(self._files.url(name)):
                metadata = pq.read_metadata(pa.BufferReader(end))
            self._footers[name] = size, self._tables.footer(table, metadata, self._files.url(name))
        for _, name, _ in addresses:
            self._footers.move_to_end(name)
        while len(self._footers) > max(_KEPT_FOOTERS, len(addresses)):
            self._footers.popitem(last=False)


def _runs(spans: Iterable[Span]) -> list[list[Span]]:
    """Row groups of the same file that lie side by side, or nearly."""
    runs: list[list[Span]] = []
    for span in sorted(spans, key=lambda span: (span[2][1], span[0])):
        last = runs[-1][-1] if runs else None
        if last and last[2][1] == span[2][1] and span[0] - last[1] <= _GAP:
            runs[-1].append(span)
        else:
            runs.append([span])
    return runs
