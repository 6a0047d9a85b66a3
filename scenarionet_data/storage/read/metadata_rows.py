"""Rows of the metadata table for chosen scenarios, straight from its Parquet files.

Only ids are read beforehand; the other columns of a file are read when the row of one of its scenarios is needed. A
million scenarios are found in a second, and one in a few milliseconds, of which SQL takes tens.
"""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Sequence
from functools import cached_property
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc

from scenarionet_data.arrays.dtypes import Bool, Int64
from scenarionet_data.schema import tables
from scenarionet_data.storage.files.lake_files import LakeFiles
from scenarionet_data.storage.read.row_table import RowTable
from scenarionet_data.storage.snapshots import snapshot as snapshots
from scenarionet_data.storage.snapshots.snapshot import Snapshot

ADDRESS_COLUMNS = tuple(
    f"{table}_{part}"
    for table in ("tracks", "lights", "maps")
    for part in ("file", "row_group", "first_row", "num_rows")
)
ALL_COLUMNS = (*tables.DESCRIPTION_COLUMNS, "content_hash", *ADDRESS_COLUMNS)
_FEW = 0.1
"""Share of a snapshot's scenarios below which these are scanned for the wanted ones, rather than indexed."""


class MetadataRows(Sequence[dict[str, Any]]):
    """Rows of scenarios, with their description and addresses.

    Args:
        files: The lake's files.
        snapshot: The snapshot.
        ids: Ids of the scenarios, strings.
        rows: (n,) int64 row of each scenario in all metadata files of the snapshot, one after the other.
        starts: (files + 1,) int64 first row of each file, and the number of all rows.
        names: Columns of the rows.
    """

    def __init__(
        self,
        files: LakeFiles,
        snapshot: Snapshot,
        ids: pa.Array,
        rows: Int64,
        starts: Int64,
        names: Sequence[str] = ALL_COLUMNS,
    ) -> None:
        self._files = files
        self._snapshot = snapshot
        self.ids = ids
        self._rows = rows
        self._starts = starts
        self._names = tuple(names)
        self._first_rows: list[int] = starts.tolist()
        self._tables: dict[int, RowTable] = {}

    def __reduce__(self) -> tuple[Any, ...]:
        return MetadataRows, (self._files, self._snapshot, self.ids, self._rows, self._starts, self._names)

    def select(self, names: Sequence[str]) -> MetadataRows:
        """The same scenarios with other columns."""
        return MetadataRows(self._files, self._snapshot, self.ids, self._rows, self._starts, names)

    @property
    def numbers(self) -> Int64:
        """(n,) row of each scenario in all metadata files, in the order on disk."""
        return self._rows

    def __len__(self) -> int:
        return len(self._rows)

    def __getitem__(self, index: Any) -> Any:
        """Row of a scenario by column."""
        row = self._rows.item(index)
        file = bisect_right(self._first_rows, row) - 1
        table = self._tables.get(file)
        if table is None:
            table = self._tables[file] = self._read(self._snapshot.metadata[file])
        return table[row - self._first_rows[file]]

    def columns(self, names: Sequence[str]) -> pa.Table:
        """Columns of all scenarios, in order."""
        with snapshots.reading_from(self._files, self._snapshot):
            parts = self._files.read_all(self._snapshot.metadata, list(names))
        schema = tables.load("metadata").schema.empty_table().select(list(names)).schema
        whole = pa.concat_tables([schema.empty_table(), *(part.select(names).cast(schema) for part in parts)])
        return whole.take(self._rows)

    def _read(self, name: str) -> RowTable:
        with snapshots.reading_from(self._files, self._snapshot):
            found = self._files.read(name, list(self._names))
        return RowTable(tables.load("metadata").conform(found, self._names))

    @cached_property
    def scenario_ids(self) -> list[str]:
        """Ids of the scenarios, in order."""
        ids: list[str] = self.ids.to_pylist()
        return ids


class ScenarioIndex:
    """The scenarios of a snapshot by id.

    Args:
        files: The lake's files.
        snapshot: The snapshot.
        with_hashes: Whether to read content hashes, to compare them.

    Raises:
        LakeError: A file of the metadata table is missing or damaged.
        SchemaMismatch: A file has a schema version that cannot be read.
    """

    def __init__(self, files: LakeFiles, snapshot: Snapshot, *, with_hashes: bool = False) -> None:
        self._files = files
        self._snapshot = snapshot
        columns = ["scenario_id", *(["content_hash"] if with_hashes else [])]
        with snapshots.reading_from(files, snapshot):
            parts = files.read_all(snapshot.metadata, columns)
        for name, part in zip(snapshot.metadata, parts, strict=True):
            tables.load("metadata").check_version(part.schema.metadata, files.url(name))
        self._starts: Int64 = np.cumsum([0, *(part.num_rows for part in parts)])
        empty = tables.load("metadata").schema.empty_table().select(columns)
        found = pa.concat_tables([empty, *(part.replace_schema_metadata(None).cast(empty.schema) for part in parts)])
        self._ids: pa.Array = found["scenario_id"].combine_chunks()
        self._hashes = found["content_hash"].to_numpy() if with_hashes else None

    def everything(self) -> MetadataRows:
        """All scenarios, ordered by id."""
        order = pc.sort_indices(self._ids)
        return self._chosen(self._ids.take(order), order.to_numpy().astype(np.int64))

    def find(self, ids: pa.Array, hashes: Any = None) -> tuple[MetadataRows, Bool]:
        """Scenarios by id, in the order of the ids.

        Args:
            ids: The ids, strings.
            hashes: (n,) uint64 content hashes; other content under an id counts as missing.

        Returns:
            The rows, and (n,) whether the snapshot has each scenario; the rows of others are not to be read.
        """
        rows = self._positions(ids)
        is_found: Bool = rows >= 0
        if hashes is not None and self._hashes is not None:
            is_found &= self._hashes[rows] == hashes if len(self._hashes) else False
        return self._chosen(ids, rows), is_found

    def _positions(self, ids: pa.Array) -> Int64:
        """(n,) row of each id, or -1."""
        if len(ids) > _FEW * len(self._ids):
            rows: Int64 = pc.index_in(ids, value_set=self._ids).fill_null(-1).to_numpy().astype(np.int64)
            return rows
        candidates = np.flatnonzero(pc.is_in(self._ids, value_set=ids).to_numpy(zero_copy_only=False))
        places = pc.index_in(ids, value_set=self._ids.take(candidates)).fill_null(-1).to_numpy()
        found: Int64 = np.append(candidates, -1)[places]
        return found

    def _chosen(self, ids: pa.Array, rows: Int64) -> MetadataRows:
        return MetadataRows(self._files, self._snapshot, ids, rows, self._starts)
