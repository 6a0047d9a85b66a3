"""Read the rows of scenarios from the tables tracks, lights and maps."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping, Sequence
from typing import Any

from scenarionet_data.arrays.columns import ColumnLayout, Columns, pick
from scenarionet_data.arrays.memory import Memory
from scenarionet_data.codec import LAYOUTS, ScenarioColumns
from scenarionet_data.errors import LakeError
from scenarionet_data.schema import tables
from scenarionet_data.storage.files.errors import reading
from scenarionet_data.storage.files.lake_files import LakeFiles
from scenarionet_data.storage.files.remote import RemoteLakeFiles
from scenarionet_data.storage.read.parquet import ColumnReader, UnreadableFile
from scenarionet_data.storage.read.row_groups import LocalRowGroups, RemoteRowGroups, RowGroupAddress, RowGroups
from scenarionet_data.storage.snapshots import snapshot as snapshots
from scenarionet_data.storage.snapshots.snapshot import Snapshot

TABLES = ("tracks", "lights", "maps")

_ADDRESS = {
    table: tuple(f"{table}_{part}" for part in ("file", "row_group", "first_row", "num_rows")) for table in TABLES
}


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
        self._readers = {table: ColumnReader(_layout(table, columns), self.memory) for table in columns or TABLES}
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
        self.prefetch(metadata, wanted)
        try:
            return {table: self._read_table(table, metadata) for table in wanted}
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
        addresses = list(dict.fromkeys([address for address, _, _ in places]))
        cached = self._cached.get(table)
        if cached and all(address in cached[0] for address in addresses):
            return cached
        groups = self._row_groups.get(addresses)
        try:
            columns = self._readers[table].read(groups)
        except UnreadableFile as error:
            with reading(error.url):
                raise
        starts, row = {}, 0
        for address, group in zip(addresses, groups, strict=True):
            starts[address] = row
            row += group.num_rows
        if row != sum([count for _, _, count in places]):  # scenarios read next are often in the same row groups
            self._cached[table] = starts, columns
        return starts, columns


def _layout(table: str, columns: Mapping[str, Collection[str]] | None) -> ColumnLayout:
    if columns is None:
        return LAYOUTS[table]
    return ColumnLayout(column for column in tables.load(table).columns if column.name in columns[table])
