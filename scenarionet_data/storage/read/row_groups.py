"""Row groups of a lake's files: memory-mapped local files, or byte ranges of an object store."""

from __future__ import annotations

import mmap
from collections import OrderedDict
from collections.abc import Collection, Iterable, Mapping, Sequence
from concurrent.futures import Future
from dataclasses import dataclass
from typing import NamedTuple, Protocol

import numpy as np

from scenarionet_data.arrays.dtypes import Array, UInt8
from scenarionet_data.schema import tables
from scenarionet_data.storage.files.errors import reading
from scenarionet_data.storage.files.lake_files import LakeFiles
from scenarionet_data.storage.files.remote import RemoteLakeFiles
from scenarionet_data.storage.integrity import verifying
from scenarionet_data.storage.integrity.seals import FileEnd
from scenarionet_data.storage.read.parquet import ColumnReader, Footer, RowGroup

_MAX_OPEN_FILES = 32
_MAX_FOOTERS = 512
_MAX_PENDING = 1024
_GAP = 2**20
"""Bytes between two row groups that are read rather than skipped: they cost less than another request."""


class RowGroupAddress(NamedTuple):
    """Location of a row group."""

    table: str
    file: str
    number: int


class RowGroups(Protocol):
    """Provides row groups of many files; for one thread."""

    def get(self, addresses: Sequence[RowGroupAddress]) -> list[RowGroup]:
        """Row groups of one table.

        Raises:
            LakeError: A file is missing or damaged; the message names it.
            SchemaMismatch: A file has a schema version that cannot be read.
        """


class LocalRowGroups:
    """Maps files into memory, and closes the least recently used ones.

    Args:
        files: The lake's files.
        readers: Column reader of each table.
    """

    def __init__(self, files: LakeFiles, readers: Mapping[str, ColumnReader]) -> None:
        self._files = files
        self._readers = readers
        self._open: OrderedDict[str, tuple[Footer, UInt8]] = OrderedDict()

    def get(self, addresses: Sequence[RowGroupAddress]) -> list[RowGroup]:
        """Row groups of one table."""
        found = []
        for table, name, number in addresses:
            if name not in self._open:
                self._open[name] = self._opened(table, name)
                if len(self._open) > _MAX_OPEN_FILES:
                    self._open.popitem(last=False)
            self._open.move_to_end(name)
            footer, content = self._open[name]
            found.append(RowGroup(footer, number, content))
        return found

    def _opened(self, table: str, name: str) -> tuple[Footer, UInt8]:
        path = self._files.path(name)
        footer = _footer(self._readers, table, self._files.end(name), str(path))
        with reading(path), path.open("rb") as file:
            return footer, np.frombuffer(mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ), np.uint8)


@dataclass(frozen=True)
class _Pending:
    """A requested range of bytes that contains a row group, and its position in the file."""

    start: int
    answer: Future[Array]


class RemoteRowGroups:
    """Reads row groups by byte range: one request each, or one for neighbours in a file.

    Footers are cached in memory and on disk.

    Args:
        files: The lake's files.
        readers: Column reader of each table.
    """

    def __init__(self, files: RemoteLakeFiles, readers: Mapping[str, ColumnReader]) -> None:
        self._files = files
        self._readers = readers
        self._footers: OrderedDict[str, Footer] = OrderedDict()
        self._pending: OrderedDict[RowGroupAddress, _Pending] = OrderedDict()

    def prefetch(self, addresses: Iterable[RowGroupAddress]) -> None:
        """Request row groups concurrently, in the order in which they will be read."""
        missing = {address: order for order, address in enumerate(dict.fromkeys(addresses))}
        missing = {address: order for address, order in missing.items() if address not in self._pending}
        if not missing:
            return
        self._read_footers(missing)
        runs = _runs([(*self._span(address), address) for address in missing])
        for run in sorted(runs, key=lambda run: min(missing[address] for _, _, address in run)):
            (start, _, address), end = run[0], run[-1][1]
            answer = self._files.submit(self._range, address.file, start, end)
            self._pending.update((address, _Pending(start, answer)) for _, _, address in run)
        while len(self._pending) > max(_MAX_PENDING, len(missing)):  # requested and never read
            self._pending.popitem(last=False)

    def get(self, addresses: Sequence[RowGroupAddress]) -> list[RowGroup]:
        """Row groups of one table, as soon as they have arrived."""
        self.prefetch(addresses)
        self._read_footers(addresses)
        found = []
        for address in addresses:
            pending = self._pending.pop(address)
            found.append(RowGroup(self._footers[address.file], address.number, pending.answer.result(), pending.start))
        return found

    def _span(self, address: RowGroupAddress) -> tuple[int, int]:
        with reading(self._files.url(address.file)):
            return self._footers[address.file].stored(address.number).span

    def _range(self, name: str, start: int, end: int) -> Array:
        return np.frombuffer(self._files.range(name, start, end), np.uint8)

    def _read_footers(self, addresses: Collection[RowGroupAddress]) -> None:
        """Read footers that are not cached, concurrently."""
        unknown = sorted({(table, name) for table, name, _ in addresses if name not in self._footers})
        ends = self._files.map(self._files.end, [name for _, name in unknown])
        for (table, name), end in zip(unknown, ends, strict=True):
            self._footers[name] = _footer(self._readers, table, end, self._files.url(name))
        for _, name, _ in addresses:
            self._footers.move_to_end(name)
        while len(self._footers) > max(_MAX_FOOTERS, len(addresses)):
            self._footers.popitem(last=False)


def _footer(readers: Mapping[str, ColumnReader], table: str, end: FileEnd, url: str) -> Footer:
    metadata = verifying.parsed(end, url)
    tables.load(table).check_version(metadata.metadata, url)
    with reading(url):
        return readers[table].footer(url, metadata, end.digests, end.body)


def _runs(
    spans: Sequence[tuple[int, int, RowGroupAddress]],
) -> list[list[tuple[int, int, RowGroupAddress]]]:
    """Group row groups (start, end, address) that are adjacent in the same file, or nearly."""
    runs: list[list[tuple[int, int, RowGroupAddress]]] = []
    for span in sorted(spans, key=lambda span: (span[2].file, span[0])):
        last = runs[-1][-1] if runs else None
        if last and last[2].file == span[2].file and span[0] - last[1] <= _GAP:
            runs[-1].append(span)
        else:
            runs.append([span])
    return runs
