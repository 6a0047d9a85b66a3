"""Who reads row groups of a lake's files: from files on this machine, or by byte ranges from an object store."""

from __future__ import annotations

import mmap
from collections import OrderedDict
from collections.abc import Collection, Iterable, Mapping, Sequence
from concurrent.futures import Future
from dataclasses import dataclass
from typing import Protocol

import pyarrow as pa
import pyarrow.parquet as pq

from scenarionet_data import tables
from scenarionet_data.codec import LoadedRows
from scenarionet_data.store.files import LakeFiles
from scenarionet_data.store.remote_files import RemoteLakeFiles
from scenarionet_data.store.row_groups import RowGroups, list_columns
from scenarionet_data.tables import Column

_OPEN_FILES = 32
_KEPT_FOOTERS = 512
_MOST_COMING = 1024
_GAP = 2**20
"""Bytes between two row groups that are rather read than left out: they cost less than a request."""

Address = tuple[str, str, int]
"""Table, file and number of a row group."""


class RowGroupReader(Protocol):
    """Reads row groups of many files; for one thread."""

    def fetch(self, addresses: Iterable[Address]) -> None:
        """Have row groups at hand that are read next."""

    def read(self, address: Address) -> LoadedRows:
        """One row group.

        Raises:
            OSError: Its file is gone or damaged.
            SchemaMismatch: Its file is of another version of the table.
        """


def open_reader(files: LakeFiles, columns: Mapping[str, Sequence[str]]) -> RowGroupReader:
    """A reader of a lake's row groups.

    Args:
        files: The lake.
        columns: Names of the columns to read, by table.
    """
    return RangeReader(files, columns) if isinstance(files, RemoteLakeFiles) else FileReader(files, columns)


class FileReader:
    """Reads files on this machine, the least recently used of many closed."""

    def __init__(self, files: LakeFiles, columns: Mapping[str, Sequence[str]]) -> None:
        self._files = files
        self._columns = columns
        self._open: OrderedDict[str, RowGroups] = OrderedDict()

    def fetch(self, addresses: Iterable[Address]) -> None:
        """Nothing: files are mapped."""

    def read(self, address: Address) -> LoadedRows:
        """One row group."""
        table, name, number = address
        opened = self._open.get(name)
        if opened is None:
            path = self._files.path(name)
            opened = self._open[name] = RowGroups.open(path, tables.load(table), self._columns[table])
            if len(self._open) > _OPEN_FILES:
                self._open.popitem(last=False)[1].close()
        self._open.move_to_end(name)
        return opened.read(number)


@dataclass(frozen=True)
class _Footer:
    """What is known of a file: its size in bytes, its footer, and its float lists among the columns to read."""

    size: int
    metadata: pq.FileMetaData
    lists: list[tuple[int, Column]]

    def span(self, number: int) -> tuple[int, int]:
        """Where a row group's bytes begin and end."""
        group = self.metadata.row_group(number)
        columns = [group.column(index) for index in range(group.num_columns)]
        starts = [min(c.data_page_offset, c.dictionary_page_offset or c.data_page_offset) for c in columns]
        return min(starts), max(s + c.total_compressed_size for s, c in zip(starts, columns, strict=True))


@dataclass(frozen=True)
class _Coming:
    """A row group on its way: it begins at ``start`` of its file, ``skipped`` bytes into what was asked for."""

    start: int
    size: int
    skipped: int
    answer: Future[memoryview]

    def content(self) -> memoryview:
        """Its bytes, once they are here."""
        return self.answer.result()[self.skipped : self.skipped + self.size]


class _Space:
    """A file of which only the row group being read is in memory, at its place in as much address space."""

    def __init__(self, footer: _Footer, columns: Sequence[str]) -> None:
        self._space = mmap.mmap(-1, footer.size, flags=mmap.MAP_PRIVATE)
        buffer = pa.py_buffer(self._space)
        file = pq.ParquetFile(pa.BufferReader(buffer), metadata=footer.metadata, pre_buffer=False)
        content = memoryview(buffer).toreadonly()  # as a file on this machine is: kernels are compiled for each kind
        self._groups = RowGroups(file, content, columns, footer.lists)

    def read(self, number: int, coming: _Coming) -> LoadedRows:
        """A row group that has come."""
        end = coming.start + coming.size
        self._space[coming.start : end] = coming.content()
        try:
            return self._groups.read(number)
        finally:
            first = coming.start // mmap.PAGESIZE * mmap.PAGESIZE
            self._space.madvise(mmap.MADV_DONTNEED, first, end - first)


class RangeReader:
    """Reads row groups by byte ranges: one request for each, fewer where they lie side by side.

    Footers are kept, in memory and as copies on this machine. What is fetched comes while others are read.
    """

    def __init__(self, files: RemoteLakeFiles, columns: Mapping[str, Sequence[str]]) -> None:
        self._files = files
        self._columns = columns
        self._footers: OrderedDict[str, _Footer] = OrderedDict()
        self._spaces: OrderedDict[str, _Space] = OrderedDict()
        self._coming: OrderedDict[Address, _Coming] = OrderedDict()

    def fetch(self, addresses: Iterable[Address]) -> None:
        """Ask for row groups, all at once, and first for what is read first."""
        wanted = dict.fromkeys(address for address in addresses if address not in self._coming)
        missing = {address: place for place, address in enumerate(wanted)}
        if not missing:
            return
        self._learn(missing)
        runs = _runs((*self._footers[address[1]].span(address[2]), address) for address in missing)
        for run in sorted(runs, key=lambda run: min(missing[address] for _, _, address in run)):
            (first, _, (_, name, _)), last = run[0], run[-1][1]
            answer = self._files.start(self._files.range, name, first, last)
            for start, end, address in run:
                self._coming[address] = _Coming(start, end - start, start - first, answer)
        while len(self._coming) > max(_MOST_COMING, len(missing)):  # nobody has read them
            self._coming.popitem(last=False)

    def read(self, address: Address) -> LoadedRows:
        """One row group."""
        table, name, number = address
        if address not in self._coming:
            self.fetch([address])
        if name not in self._spaces:
            self._learn([address])
            self._spaces[name] = _Space(self._footers[name], self._columns[table])
            if len(self._spaces) > _OPEN_FILES:
                self._spaces.popitem(last=False)
        self._spaces.move_to_end(name)
        return self._spaces[name].read(number, self._coming.pop(address))

    def _learn(self, addresses: Collection[Address]) -> None:
        """Read the footers of files that are not known yet."""
        unknown = sorted({(table, name) for table, name, _ in addresses if name not in self._footers})
        for (table, name), (size, end) in zip(
            unknown, self._files.side_by_side(self._files.end, [name for _, name in unknown]), strict=True
        ):
            footer, declared = pq.read_metadata(pa.BufferReader(end)), tables.load(table)
            declared.check_version(footer.metadata, self._files.url(name))
            self._footers[name] = _Footer(size, footer, list_columns(footer, declared, self._columns[table]))
        for _, name, _ in addresses:
            self._footers.move_to_end(name)
        while len(self._footers) > max(_KEPT_FOOTERS, len(addresses)):
            self._footers.popitem(last=False)


Span = tuple[int, int, Address]


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
