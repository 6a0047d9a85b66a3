"""Databases on their way into a file: members are written as they come, so that memory holds few of them."""

from __future__ import annotations

import json
from collections.abc import Iterable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import asdict, replace

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc
import pyarrow.parquet as pq

from scenarionet_data.databases import record as databases
from scenarionet_data.databases.record import Database, Lineage
from scenarionet_data.schema import tables
from scenarionet_data.storage.files.errors import writing
from scenarionet_data.storage.files.lake_files import LakeFiles

_ROWS_PER_GROUP = 65_536  # DuckDB's threads take a group each


class Draft:
    """A database that is being written, and gets its name when it is complete.

    Attributes:
        count: Members so far.
    """

    def __init__(self, files: LakeFiles) -> None:
        self.count = 0
        self._files = files
        self._path = files.temporary()
        self._waiting: list[pa.RecordBatch] = []
        self._num_waiting = 0
        with writing(self._path, self._path):
            self._writer = tables.load("members").writer(self._path, {})

    def add(self, rows: pa.RecordBatch) -> None:
        """Write further members: scenario_id, weight and content_hash, in order."""
        self._waiting.append(rows.select(["scenario_id", "weight", "content_hash"]))
        self._num_waiting += rows.num_rows
        self.count += rows.num_rows
        if self._num_waiting >= _ROWS_PER_GROUP:
            self._write(self._num_waiting - self._num_waiting % _ROWS_PER_GROUP)

    def finish(self, lineage: Lineage) -> None:
        """Complete the file."""
        if self._num_waiting:
            self._write(self._num_waiting)
        with writing(self._path):
            told = json.dumps(asdict(replace(lineage, count=self.count)))
            self._writer.add_key_value_metadata({"scenarionet.lineage": told})
            self._writer.close()

    def ids(self) -> Iterator[pa.Array]:
        """scenario_id of the members of a finished draft, a row group at a time."""
        with pq.ParquetFile(self._path) as file:
            for batch in file.iter_batches(_ROWS_PER_GROUP, columns=["scenario_id"]):
                yield batch["scenario_id"]

    def publish(self, name: str, *, replace: bool) -> Database:
        """Give a finished draft its name; of two that publish the same version at once, one takes the next.

        Args:
            name: Its name.
            replace: Make a further version when there is one already.

        Raises:
            DatabaseExists: There is one and ``replace`` is False.
        """
        while True:
            version = (databases.versions(self._files, name) or [0])[-1] + 1
            databases.check_free(self._files, name, replace=replace)  # last, or a rival's version comes between
            if self._files.publish_new(databases.path(name, version), self._path):
                return databases.read(self._files, name, version)

    def discard(self) -> None:
        """Remove what has no name."""
        with suppress(OSError):  # where the disk is full, the file's end cannot be written
            self._writer.close()
        self._path.unlink(missing_ok=True)

    def _write(self, count: int) -> None:
        """Write so many of the waiting members, with their places."""
        waiting = pa.Table.from_batches(self._waiting)
        rows, first = waiting.slice(0, count), self.count - self._num_waiting
        numbers = np.arange(first, first + count, dtype=np.int32)
        # pa.array would import pandas, wherever that is installed: 50 MB.
        places = pa.Array.from_buffers(pa.int32(), count, [None, pa.py_buffer(numbers)])
        schema = tables.load("members").schema
        content = rows.append_column("position", places).select(schema.names).cast(schema)
        with writing(self._path):
            self._writer.write_table(content, row_group_size=_ROWS_PER_GROUP)
        self._waiting = waiting.slice(count).to_batches()
        self._num_waiting -= count


@contextmanager
def drafts(files: LakeFiles, names: Iterable[str]) -> Iterator[dict[str, Draft]]:
    """A draft for each name; what is not published in the end is gone."""
    made: dict[str, Draft] = {}
    try:
        for name in names:
            made[name] = Draft(files)
        yield made
    finally:
        for draft in made.values():
            draft.discard()


def save(files: LakeFiles, name: str, members: pa.Table, lineage: Lineage, *, replace: bool) -> Database:
    """Publish members that are in memory; see :meth:`Draft.publish`."""
    with drafts(files, [name]) as made:
        for batch in members.to_batches():
            made[name].add(batch)
        made[name].finish(lineage)
        return made[name].publish(name, replace=replace)


def only(rows: pa.RecordBatch, column: str, value: str) -> pa.RecordBatch:
    """Rows whose column has a value, without that column."""
    kept = rows.filter(pc.equal(rows[column], pa.scalar(value, pa.string())))
    return kept.select([name for name in kept.schema.names if name != column])
