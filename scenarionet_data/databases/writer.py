"""Writers of databases: members are written batch by batch, with bounded memory."""

from __future__ import annotations

import json
from collections.abc import Iterable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc
import pyarrow.parquet as pq

from scenarionet_data.databases import record as records
from scenarionet_data.databases.record import DatabaseRecord, Lineage
from scenarionet_data.databases.row_sets import RowSets
from scenarionet_data.errors import LakeError
from scenarionet_data.schema import tables
from scenarionet_data.storage.files.errors import writing
from scenarionet_data.storage.files.lake_files import LakeFiles
from scenarionet_data.storage.integrity import seals

_ROWS_PER_GROUP = 65_536  # one row group per DuckDB thread


@dataclass
class DatabaseWriter:
    """Writes one database to a temporary file, which gets its name once it is complete.

    Attributes:
        files: Files of the lake.
        path: The temporary file.
        table: Its writer.
        count: Members written so far.
    """

    files: LakeFiles
    path: Path
    table: pq.ParquetWriter
    count: int = 0
    _lineage: Lineage | None = None
    _waiting: list[pa.RecordBatch] = field(default_factory=list)
    _num_waiting: int = 0

    def add(self, rows: pa.RecordBatch | RowSets) -> None:
        """Append members: columns scenario_id, weight and content_hash, in order; or take all of them as rows."""
        if isinstance(rows, RowSets):
            self.count = len(rows)
            with writing(self.path):
                self.table.close()
                self.table = tables.load("member_bits").writer(self.path, {})
                self.table.write_table(rows.to_table())
            return
        self._waiting.append(rows.select(["scenario_id", "weight", "content_hash"]))
        self._num_waiting += rows.num_rows
        self.count += rows.num_rows
        if self._num_waiting >= _ROWS_PER_GROUP:
            self._write(self._num_waiting - self._num_waiting % _ROWS_PER_GROUP)

    def finish(self, lineage: Lineage) -> None:
        """Write the lineage and close the file."""
        if self._num_waiting:
            self._write(self._num_waiting)
        self._lineage = replace(lineage, count=self.count)
        with writing(self.path):
            self.table.add_key_value_metadata({"scenarionet.lineage": json.dumps(self._lineage.to_dict())})
            self.table.close()

    def ids(self) -> Iterator[pa.Array]:
        """Yield scenario_id of the members after :meth:`finish`, one row group at a time."""
        with pq.ParquetFile(self.path) as file:
            for batch in file.iter_batches(_ROWS_PER_GROUP, columns=["scenario_id"]):
                yield batch["scenario_id"]

    def publish(self, name: str, *, replace: bool) -> DatabaseRecord:
        """Publish the finished file; of two writers that publish the same version concurrently, one takes the next.

        Args:
            name: Name of the database.
            replace: Add a version if the database exists.

        Raises:
            DatabaseExists: The database exists and ``replace`` is False.
        """
        if self._lineage is None:
            raise LakeError(f"{name}: call finish() before publish()")
        while True:
            version = records.next_version(self.files, name)
            # Checked after listing: a version that a rival publishes in between makes publish_new fail instead.
            records.check_free(self.files, name, replace=replace)
            file = records.path(name, version)
            with writing(self.path):
                seals.seal(self.path, self.files.place_to_write(file))
            if self.files.publish_new(file, self.path):
                return DatabaseRecord(name, version, self._lineage, self.files)

    def _write(self, count: int) -> None:
        """Write the first ``count`` waiting members, with their positions."""
        waiting = pa.Table.from_batches(self._waiting)
        rows, first = waiting.slice(0, count), self.count - self._num_waiting
        numbers = np.arange(first, first + count, dtype=np.int32)
        # pa.array would import pandas if installed, which takes 50 MB.
        positions = pa.Array.from_buffers(pa.int32(), count, [None, pa.py_buffer(numbers)])
        content = tables.load("members").conform(rows.append_column("position", positions))
        with writing(self.path):
            self.table.write_table(content, row_group_size=_ROWS_PER_GROUP)
        self._waiting = waiting.slice(count).to_batches()
        self._num_waiting -= count


@contextmanager
def database_writers(files: LakeFiles, names: Iterable[str]) -> Iterator[dict[str, DatabaseWriter]]:
    """Open a writer for each name; files that are not published are removed at the end."""
    writers: dict[str, DatabaseWriter] = {}
    try:
        for name in names:
            path = files.temporary()
            with writing(path, path):
                writers[name] = DatabaseWriter(files, path, tables.load("members").writer(path, {}))
        yield writers
    finally:
        for writer in writers.values():
            with suppress(OSError):  # on a full disk, the footer cannot be written
                writer.table.close()
            writer.path.unlink(missing_ok=True)


def save(
    files: LakeFiles, name: str, members: pa.Table | RowSets, lineage: Lineage, *, replace: bool
) -> DatabaseRecord:
    """Publish members that are in memory; see :meth:`DatabaseWriter.publish`."""
    with database_writers(files, [name]) as writers:
        for batch in members.to_batches() if isinstance(members, pa.Table) else [members]:
            writers[name].add(batch)
        writers[name].finish(lineage)
        return writers[name].publish(name, replace=replace)


def rows_of_part(rows: pa.RecordBatch, part: str) -> pa.RecordBatch:
    """Return the rows of one part of a split, without the column ``part``."""
    kept = rows.filter(pc.equal(rows["part"], pa.scalar(part, pa.string())))
    return kept.select([name for name in kept.schema.names if name != "part"])
