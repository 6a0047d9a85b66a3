"""Rows of the metadata table for chosen scenarios, straight from its Parquet files.

At most ids are read beforehand, and none of scenarios whose rows are known; the other columns of a row group are
read when the row of one of its scenarios is needed.
"""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Callable, Sequence
from functools import cached_property
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc

from scenarionet_data.arrays.dtypes import Bool, Int32, Int64
from scenarionet_data.errors import LakeError
from scenarionet_data.schema import tables
from scenarionet_data.storage.files.lake_files import LakeFiles
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


class RowTable:
    """Rows of an Arrow table as dicts, one at a time, in a fifth of the time that Arrow takes.

    Polars would be faster, but does not survive a fork, and loaders run in forked workers.

    Args:
        table: The rows.
    """

    def __init__(self, table: pa.Table) -> None:
        self.table = table.combine_chunks()
        self._row: dict[str, Any] = dict.fromkeys(table.column_names)  # of all rows alike, and places for the others
        self._texts: list[tuple[str, Callable[[int], int], memoryview]] = []
        self._numbers: list[tuple[str, Callable[[int], Any]]] = []
        self._others: list[tuple[str, pa.Array]] = []
        for name, chunked in zip(table.column_names, self.table.columns, strict=True):
            column = chunked.chunk(0) if chunked.num_chunks == 1 else chunked.combine_chunks()
            kind = column.type
            if column.null_count == len(column):
                continue
            if pa.types.is_string(kind) and not column.null_count:
                _, ends, data = column.buffers()
                # A slice of the bytes takes a third of the time of a scalar.
                self._texts.append((name, np.frombuffer(ends, np.int32)[column.offset :].item, memoryview(data or b"")))
            elif pa.types.is_dictionary(kind) and len(column.dictionary) == 1 and not column.null_count:
                self._row[name] = column.dictionary[0].as_py()
            elif column.null_count or pa.types.is_nested(kind) or pa.types.is_dictionary(kind):
                self._others.append((name, column))
            else:
                values = np.asarray(column.to_numpy(zero_copy_only=False))
                if values.tobytes() == values[:1].tobytes() * len(values):  # 0.0 is not -0.0
                    self._row[name] = values.item(0)
                else:
                    self._numbers.append((name, values.item))

    def __reduce__(self) -> tuple[Any, ...]:
        return RowTable, (self.table,)

    def __len__(self) -> int:
        return int(self.table.num_rows)

    def __getitem__(self, index: int) -> dict[str, Any]:
        """A row, with the values that ``to_pylist`` gives."""
        row = self._row.copy()
        for name, end, content in self._texts:
            row[name] = str(content[end(index) : end(index + 1)], "utf-8")
        for name, value in self._numbers:
            row[name] = value(index)
        for name, column in self._others:
            row[name] = column[index].as_py()
        return row


GroupPlaces = tuple[list[int], list[tuple[str, int]]]
"""First row of each row group of all files, one after the other; the file of each, and its number there."""


def row_groups(files: LakeFiles, snapshot: Snapshot) -> GroupPlaces:
    """Find the row groups of a snapshot's metadata files.

    Raises:
        LakeError: A file is missing or damaged.
        SchemaMismatch: A file has a schema version that cannot be read.
    """
    firsts, groups = [0], list[tuple[str, int]]()
    with snapshots.reading_from(files, snapshot):
        for name in snapshot.metadata:
            footer = files.footer(name)
            tables.load("metadata").check_version(footer.metadata, files.url(name))
            for number in range(footer.num_row_groups):
                groups.append((name, number))
                firsts.append(firsts[-1] + footer.row_group(number).num_rows)
    return firsts, groups


class MetadataRows(Sequence[dict[str, Any]]):
    """Rows of scenarios, with their description and addresses.

    Args:
        files: The lake's files.
        snapshot: The snapshot.
        ids: Ids of the scenarios, strings; None to read them when they are asked for.
        rows: (n,) row of each scenario in all metadata files of the snapshot, one after the other.
        names: Columns of the rows.
        groups: Row groups of these files; read from them by default.
    """

    def __init__(
        self,
        files: LakeFiles,
        snapshot: Snapshot,
        ids: pa.Array | None,
        rows: Int32 | Int64,
        names: Sequence[str] = ALL_COLUMNS,
        groups: GroupPlaces | None = None,
    ) -> None:
        self._files = files
        self._snapshot = snapshot
        self._ids = ids
        self._rows = rows
        self._names = tuple(names)
        self._groups = groups or row_groups(files, snapshot)
        self._tables: dict[int, RowTable] = {}

    def __reduce__(self) -> tuple[Any, ...]:
        return MetadataRows, (self._files, self._snapshot, self._ids, self._rows, self._names, self._groups)

    def select(self, names: Sequence[str]) -> MetadataRows:
        """The same scenarios with other columns."""
        return MetadataRows(self._files, self._snapshot, self._ids, self._rows, names, self._groups)

    @property
    def ids(self) -> pa.Array:
        """Ids of the scenarios, strings, in order."""
        if self._ids is None:
            self._ids = self.columns(["scenario_id"])["scenario_id"].combine_chunks()
        return self._ids

    @property
    def numbers(self) -> Int64:
        """(n,) row of each scenario in all metadata files, in the order on disk."""
        return self._rows.astype(np.int64)

    def __len__(self) -> int:
        return len(self._rows)

    def __getitem__(self, index: Any) -> Any:
        """Row of a scenario by column."""
        row = self._rows.item(index)
        firsts, groups = self._groups
        number = bisect_right(firsts, row) - 1
        table = self._tables.get(number)
        if table is None:
            try:
                found = self._files.read(groups[number][0], list(self._names), groups[number][1])
            except LakeError as error:
                snapshots.check_expired(self._files, self._snapshot, error)
                raise
            table = self._tables[number] = RowTable(tables.load("metadata").conform(found, self._names))
        return table[row - firsts[number]]

    def columns(self, names: Sequence[str]) -> pa.Table:
        """Columns of all scenarios, in order."""
        with snapshots.reading_from(self._files, self._snapshot):
            return rows_of(self._files, self._snapshot.metadata, names).take(self._rows)

    @cached_property
    def scenario_ids(self) -> list[str]:
        """Ids of the scenarios, in order."""
        ids: list[str] = self.ids.to_pylist()
        return ids


def first_rows(files: LakeFiles, metadata: Sequence[str]) -> Int64:
    """(files + 1,) first row of each metadata file, one after the other, and the number of all rows.

    Raises:
        LakeError: A file is missing or damaged.
        SchemaMismatch: A file has a schema version that cannot be read.
    """
    footers = list(map(files.footer, metadata))
    for name, footer in zip(metadata, footers, strict=True):
        tables.load("metadata").check_version(footer.metadata, files.url(name))
    return np.cumsum([0, *(footer.num_rows for footer in footers)])


def rows_of(files: LakeFiles, metadata: Sequence[str], names: Sequence[str]) -> pa.Table:
    """Columns of metadata files, one file after the other.

    Raises:
        LakeError: A file is missing or damaged.
        SchemaMismatch: A file has a schema version that cannot be read.
    """
    parts, table = files.read_all(metadata, list(names)), tables.load("metadata")
    for name, part in zip(metadata, parts, strict=True):
        table.check_version(part.schema.metadata, files.url(name))
    empty = table.schema.empty_table().select(list(names))
    return pa.concat_tables([empty, *(table.conform(part, names) for part in parts)])


def order_of_ids(files: LakeFiles, metadata: Sequence[str]) -> Int32:
    """(n,) rows of metadata files, one file after the other, in the order of the scenarios' ids.

    Raises:
        LakeError: A file is missing or damaged.
    """
    stored = snapshots.order_file(metadata)
    if files.has(stored):
        order: Int32 = tables.load("id_order").conform(files.read(stored))["row"].to_numpy()
    else:
        ids = rows_of(files, metadata, ["scenario_id"])["scenario_id"].combine_chunks()
        order = pc.sort_indices(ids).to_numpy().astype(np.int32)
    return order


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
            found = rows_of(files, snapshot.metadata, columns)
        self._ids: pa.Array = found["scenario_id"].combine_chunks()
        self._hashes = found["content_hash"].to_numpy() if with_hashes else None

    def find(self, ids: pa.Array, hashes: Any = None) -> tuple[MetadataRows, Bool]:
        """Scenarios by id, in the order of the ids.

        Args:
            ids: The ids, strings.
            hashes: (n,) uint64 content hashes; other content under an id counts as missing.

        Returns:
            The rows, and (n,) whether the snapshot has each scenario; the rows of others are not to be read.
        """
        if len(ids) > _FEW * len(self._ids):
            rows: Int64 = pc.index_in(ids, value_set=self._ids).fill_null(-1).to_numpy().astype(np.int64)
        else:
            candidates = np.flatnonzero(pc.is_in(self._ids, value_set=ids).to_numpy(zero_copy_only=False))
            places = pc.index_in(ids, value_set=self._ids.take(candidates)).fill_null(-1).to_numpy()
            rows = np.append(candidates, -1)[places]
        is_found: Bool = rows >= 0
        if hashes is not None and self._hashes is not None:
            is_found &= self._hashes[rows] == hashes if len(self._hashes) else False
        return MetadataRows(self._files, self._snapshot, ids, rows), is_found
