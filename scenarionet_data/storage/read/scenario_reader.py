"""Read the rows of scenarios from the tables tracks, lights and maps.

Their row groups are in memory-mapped local files, or byte ranges of an object store.
"""

from __future__ import annotations

import mmap
from collections import OrderedDict
from collections.abc import Collection, Iterable, Mapping, Sequence
from concurrent.futures import Future
from dataclasses import dataclass
from operator import itemgetter
from typing import Any, NamedTuple, Protocol

import numpy as np

from scenarionet_data.arrays.columns import ColumnLayout, Columns, pick
from scenarionet_data.arrays.dtypes import UInt8
from scenarionet_data.arrays.memory import Memory
from scenarionet_data.codec import LAYOUTS, ScenarioColumns
from scenarionet_data.errors import LakeError
from scenarionet_data.schema import tables
from scenarionet_data.storage.files.errors import reading
from scenarionet_data.storage.files.lake_files import LakeFiles
from scenarionet_data.storage.files.remote import RemoteLakeFiles
from scenarionet_data.storage.integrity import seals
from scenarionet_data.storage.integrity.file_end import FileEnd
from scenarionet_data.storage.read.parquet import ColumnReader, Footer, RowGroup, UnreadableFile
from scenarionet_data.storage.snapshots import snapshot as snapshots
from scenarionet_data.storage.snapshots.snapshot import Snapshot

TABLES = ("tracks", "lights", "maps")

_ADDRESS = {
    table: tuple(f"{table}_{part}" for part in ("file", "row_group", "first_row", "num_rows")) for table in TABLES
}
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


class ScenarioReader:
    """Reads rows of scenarios; for one thread.

    The row groups of the last call are cached when they hold other scenarios, too.

    Args:
        files: The lake's files.
        snapshot: The snapshot of the scenarios.
        columns: Columns of each table to read; by default those that a scenario is decoded from.

    Attributes:
        memory: Memory of the arrays that it returns.
    """

    def __init__(
        self,
        files: LakeFiles,
        snapshot: Snapshot,
        *,
        columns: Mapping[str, Collection[str]] | None = None,
    ) -> None:
        self._files = files
        self._snapshot = snapshot
        self.memory, self._decoded = Memory(), Memory()
        self._readers: dict[str, ColumnReader] = {}
        for table in columns or TABLES:
            layout = LAYOUTS[table]
            if columns is not None:
                layout = ColumnLayout(column for column in tables.load(table).columns if column.name in columns[table])
            self._readers[table] = ColumnReader(layout, self.memory)
        self._remote = RemoteRowGroups(files, self._readers) if isinstance(files, RemoteLakeFiles) else None
        self._row_groups: RowGroups = self._remote or LocalRowGroups(files, self._readers)
        self._cached: dict[str, tuple[dict[RowGroupAddress, int], Columns]] = {}

    def prefetch(self, metadata: Iterable[Mapping[str, Any]], wanted: Sequence[str]) -> None:
        """Request the row groups of scenarios that will be read next.

        Args:
            metadata: Their rows of the metadata table.
            wanted: A subset of TABLES.
        """
        if self._remote is None:  # the operating system reads mapped files ahead
            return
        cached = {address for starts, _ in self._cached.values() for address in starts}
        places = [_ADDRESS[table] for table in wanted]
        addresses = [
            RowGroupAddress(table, row[file], row[row_group])
            for row in metadata
            for table, (file, row_group, _, _) in zip(wanted, places, strict=True)
            if row[file]
        ]
        with snapshots.reading_from(self._files, self._snapshot):
            self._remote.prefetch(address for address in addresses if address not in cached)

    def read(self, metadata: Sequence[Mapping[str, Any]], wanted: Sequence[str]) -> dict[str, ScenarioColumns | None]:
        """Rows of scenarios by table; None for a table in which none of them has rows.

        Args:
            metadata: Their rows of the metadata table.
            wanted: A subset of TABLES.

        Raises:
            LakeError: A file is missing or damaged; the message names it.
            SchemaMismatch: A file has a schema version that cannot be read.
        """
        found = {}
        if self._remote:
            self.prefetch(metadata, wanted)
        try:
            for table in wanted:
                found[table] = self._read_table(table, metadata)
            return found
        except LakeError as error:
            snapshots.check_expired(self._files, self._snapshot, error)
            raise

    def _read_table(self, table: str, metadata: Sequence[Mapping[str, Any]]) -> ScenarioColumns | None:
        file, row_group, first_row, num_rows = _ADDRESS[table]
        places, bounds, total = [], [0], 0
        for row in metadata:
            if row[file]:
                places.append((RowGroupAddress(table, row[file], row[row_group]), row[first_row], row[num_rows]))
            total += row[num_rows] or 0
            bounds.append(total)
        if not places:
            return None
        starts, columns = self._row_groups_of(table, places)
        spans: list[tuple[int, int]] = []
        are_adjacent, end = True, 0
        for address, first, count in places:
            start = starts[address] + first
            if first < 0 or count < 0 or start + count > columns.num_rows:
                raise LakeError(
                    "a file has fewer rows than its metadata; `scenarionet maintain fsck` names it and the remedy"
                )
            are_adjacent &= not spans or start == end
            spans.append((start, count))
            end = start + count
        begin = spans[0][0]
        if not are_adjacent:
            columns = pick(columns, spans)
        elif begin:
            bounds = [begin + bound for bound in bounds]
        return ScenarioColumns(columns, bounds, self._decoded)

    def _row_groups_of(
        self, table: str, places: Sequence[tuple[RowGroupAddress, int, int]]
    ) -> tuple[Mapping[RowGroupAddress, int], Columns]:
        """Row groups of scenarios, concatenated, and the first row of each.

        Args:
            table: The table.
            places: Row group, first row in it, and number of rows of each scenario.
        """
        addresses = dict.fromkeys(map(itemgetter(0), places))
        cached = self._cached.get(table)
        if cached and addresses.keys() <= cached[0].keys():
            return cached
        groups = self._row_groups.get(list(addresses))
        starts, row = {}, 0
        try:
            columns = self._readers[table].read(groups)
            for address, group in zip(addresses, groups, strict=True):
                starts[address] = row
                row += group.footer.stored(group.number).num_rows
        except UnreadableFile as error:
            with reading(error.url):
                raise
        if row != sum(map(itemgetter(2), places)):  # scenarios read next are often in the same row groups
            self._cached[table] = starts, columns
        return starts, columns


def with_tracks(metadata: Sequence[Mapping[str, Any]], rows: Mapping[str, ScenarioColumns | None]) -> ScenarioColumns:
    """The tracks of scenarios.

    Raises:
        LakeError: They have none.
    """
    tracks = rows["tracks"]
    if tracks is None:
        raise LakeError(
            f"{metadata[0]['scenario_id']} has no tracks; `scenarionet maintain check` lists all such scenarios: "
            "convert them again"
        )
    return tracks


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
                path = self._files.path(name)
                footer = _footer(self._readers[table], table, self._files.end(name), str(path))
                with reading(path), path.open("rb") as file:
                    content = np.frombuffer(mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ), np.uint8)
                self._open[name] = footer, content
                if len(self._open) > _MAX_OPEN_FILES:
                    self._open.popitem(last=False)
            self._open.move_to_end(name)
            footer, content = self._open[name]
            found.append(RowGroup(footer, number, content))
        return found


@dataclass(frozen=True)
class _Pending:
    """A requested range of bytes that contains a row group, and its position in the file."""

    start: int
    answer: Future[memoryview]


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
        spans = []
        for address in missing:
            with reading(self._files.url(address.file)):
                spans.append((*self._footers[address.file].stored(address.number).span, address))
        runs: list[list[tuple[int, int, RowGroupAddress]]] = []
        for span in sorted(spans, key=lambda span: (span[2].file, span[0])):
            last = runs[-1][-1] if runs else None
            if last and last[2].file == span[2].file and span[0] - last[1] <= _GAP:
                runs[-1].append(span)
            else:
                runs.append([span])
        for run in sorted(runs, key=lambda run: min(missing[address] for _, _, address in run)):
            (start, _, address), end = run[0], run[-1][1]
            answer = self._files.submit(self._files.range, address.file, start, end)
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
            content = np.frombuffer(pending.answer.result(), np.uint8)
            found.append(RowGroup(self._footers[address.file], address.number, content, pending.start))
        return found

    def _read_footers(self, addresses: Collection[RowGroupAddress]) -> None:
        """Read footers that are not cached, concurrently."""
        unknown = sorted({(table, name) for table, name, _ in addresses if name not in self._footers})
        ends = self._files.map(self._files.end, [name for _, name in unknown])
        for (table, name), end in zip(unknown, ends, strict=True):
            self._footers[name] = _footer(self._readers[table], table, end, self._files.url(name))
        for _, name, _ in addresses:
            self._footers.move_to_end(name)
        while len(self._footers) > max(_MAX_FOOTERS, len(addresses)):
            self._footers.popitem(last=False)


def _footer(reader: ColumnReader, table: str, end: FileEnd, url: str) -> Footer:
    metadata = seals.parsed(end, url)
    tables.load(table).check_version(metadata.metadata, url)
    with reading(url):
        return Footer(url, metadata, reader.layout, end.digests, end.body)
