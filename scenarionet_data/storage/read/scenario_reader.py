"""Read the rows of scenarios from the tables tracks, lights and maps."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping, Sequence
from itertools import accumulate
from typing import Any

from scenarionet_data.arrays.columns import ColumnLayout, Columns
from scenarionet_data.arrays.memory import Memory
from scenarionet_data.arrays.packed_columns import pick
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
        with_ids: Whether to read scenario_id as well.
        columns: Columns of each table to read; by default those that a scenario is decoded from.

    Attributes:
        memory: Memory of the arrays that it returns.
    """

    def __init__(
        self,
        files: LakeFiles,
        snapshot: Snapshot,
        *,
        with_ids: bool = False,
        columns: Mapping[str, Collection[str]] | None = None,
    ) -> None:
        self._files = files
        self._snapshot = snapshot
        self.memory = Memory()
        self._readers = {
            table: ColumnReader(_layout(table, with_ids, columns), self.memory) for table in columns or TABLES
        }
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
        addresses = [address for row in metadata for table in wanted if (address := _address(table, row))]
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
        with snapshots.reading_from(self._files, self._snapshot):
            return {table: self._read_table(table, metadata) for table in wanted}

    def _read_table(self, table: str, metadata: Sequence[Mapping[str, Any]]) -> ScenarioColumns | None:
        _, _, first_row, num_rows = _ADDRESS[table]
        wanted = [(address, row[first_row], row[num_rows]) for row in metadata if (address := _address(table, row))]
        if not wanted:
            return None
        addresses = dict.fromkeys([address for address, _, _ in wanted])
        starts, columns = self._cached.get(table, ({}, None))
        if columns is None or not addresses.keys() <= starts.keys():
            starts, columns = self._read_row_groups(table, list(addresses))
        places = []
        for address, first, count in wanted:
            start = starts[address] + first
            if first < 0 or count < 0 or start + count > columns.num_rows:
                raise LakeError("a file has fewer rows than its metadata; `scenarionet fsck` names it and the remedy")
            places.append((start, count))
        if [first for first, _ in places] != list(starts.values()) or sum(places[-1]) != columns.num_rows:
            self._cached[table] = starts, columns  # shared row groups: scenarios read next are often in them
        begin = places[0][0]
        if [sum(place) for place in places[:-1]] != [first for first, _ in places[1:]]:
            columns, begin = pick(columns, places), 0
        return ScenarioColumns(columns, list(accumulate([row[num_rows] or 0 for row in metadata], initial=begin)))

    def _read_row_groups(
        self, table: str, addresses: list[RowGroupAddress]
    ) -> tuple[dict[RowGroupAddress, int], Columns]:
        """Rows of row groups, concatenated, and the first row of each."""
        groups = self._row_groups.get(addresses)
        try:
            columns = self._readers[table].read(groups)
        except UnreadableFile as error:
            with reading(error.url):
                raise
        return dict(zip(addresses, accumulate([group.num_rows for group in groups], initial=0), strict=False)), columns


def _layout(table: str, with_ids: bool, columns: Mapping[str, Collection[str]] | None) -> ColumnLayout:
    wanted = {column.name for column in LAYOUTS[table].columns} if columns is None else columns[table]
    ids = {"scenario_id"} if with_ids else set()
    return ColumnLayout(column for column in tables.load(table).columns if column.name in {*wanted, *ids})


def _address(table: str, row: Mapping[str, Any]) -> RowGroupAddress | None:
    """Row group of a scenario in one table; None if it has no rows there."""
    file, row_group, *_ = _ADDRESS[table]
    return RowGroupAddress(table, row[file], row[row_group]) if row[file] else None
