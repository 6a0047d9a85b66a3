"""Read one scenario's rows by address, also from a row group shared with other scenarios."""

from __future__ import annotations

from typing import NamedTuple

import pyarrow as pa
import pyarrow.parquet as pq

from scenarionet_data.schema import tables
from scenarionet_data.storage.files.errors import reading
from scenarionet_data.storage.files.lake_files import LakeFiles


class RowAddress(NamedTuple):
    """Location of a scenario's rows in one table; None in the first three where ``num_rows`` is 0."""

    file: str
    row_group: int
    first_row: int
    num_rows: int


class ScenarioRows:
    """Reads scenarios of one table; consecutive reads from the same row group decode it once.

    Args:
        files: The lake's files.
        table: Name of the table.
    """

    def __init__(self, files: LakeFiles, table: str) -> None:
        self._files = files
        self._table = tables.load(table)
        self._name = ""
        self._number = -1
        self._group = pa.table({})

    def read(self, address: RowAddress) -> pa.Table:
        """Rows of a scenario, with the columns of its file.

        Raises:
            LakeError: The file is missing or damaged.
            SchemaMismatch: The file has a schema version that cannot be read.
        """
        name, number, first, num_rows = address
        path = self._files.verified(name)
        with reading(path):
            if name != self._name:
                self._file = pq.ParquetFile(path)
                self._table.check_version(self._file.metadata.metadata, str(path))
            if (name, number) != (self._name, self._number):
                self._group = self._file.read_row_group(number, use_threads=False).replace_schema_metadata(None)
            self._name, self._number = name, number
        return self._group.slice(first, num_rows)
