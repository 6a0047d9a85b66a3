"""The rows of one scenario in one table, by their address: whoever shares its row group."""

from __future__ import annotations

from pathlib import Path

import pyarrow as pa
import pyarrow.parquet as pq

from scenarionet_data.schema import tables
from scenarionet_data.storage.files.errors import reading
from scenarionet_data.storage.files.lake_files import LakeFiles

Address = tuple[str, int, int, int]
"""File, row group, first row and number of rows of a scenario in a table."""


class ScenarioRows:
    """Reads scenarios of one table; those that follow each other in a row group cost one reading.

    Args:
        files: The lake.
        table: Name of the table.
    """

    def __init__(self, files: LakeFiles, table: str) -> None:
        self._files = files
        self._table = tables.load(table)
        self._name = ""
        self._number = -1
        self._group = pa.table({})

    def read(self, name: str, number: int, first: int, num_rows: int) -> pa.Table:
        """Rows of a scenario, columns as the file has them.

        Raises:
            LakeError: The file is gone or damaged.
            SchemaMismatch: It is of another version of the table.
        """
        path = self._files.path(name)
        with reading(path):
            if name != self._name:
                self._file = pq.ParquetFile(path)
                self._table.check_version(self._file.metadata.metadata, str(path))
            if (name, number) != (self._name, self._number):
                self._group = self._file.read_row_group(number, use_threads=False).replace_schema_metadata(None)
            self._name, self._number = name, number
        return self._group.slice(first, num_rows)

    def write_alone(self, address: Address, path: Path) -> None:
        """Write a scenario's rows as the only row group of a file, as converting would."""
        rows = self.read(*address).combine_chunks().cast(self._table.schema)
        with self._table.writer(path, {}, rows) as writer:
            writer.write_table(rows, row_group_size=rows.num_rows)
