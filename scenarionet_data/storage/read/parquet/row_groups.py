"""What a file says about its row groups, and a row group with its bytes."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
import pyarrow.parquet as pq

from scenarionet_data.arrays.dtypes import Array
from scenarionet_data.schema.tables import Column, Table
from scenarionet_data.storage.read.parquet import page_kernels as kernels

_CODECS = {"LZ4": kernels.LZ4, "ZSTD": kernels.ZSTD}
_PLAIN = 1 << kernels.PLAIN
_KNOWN = {
    "float32": _PLAIN | 1 << kernels.BYTE_STREAM_SPLIT,
    "int32": _PLAIN,
    "bool": _PLAIN,
    "string": _PLAIN,
    "json": _PLAIN,
    "dictionary": 1 << kernels.INDICES,
}
"""Encodings that compiled loops know, a bit each, by type."""
_LARGEST = 2**30
"""Bytes of a column in a row group that a damaged footer may ask for; Arrow judges what is larger."""


def _known(column: Column) -> int:
    is_float = column.type == "int32" and column.nullable  # none that is loaded
    return 0 if is_float else _KNOWN.get(column.element, 0)


class Footer:
    """What a file says about its row groups.

    Args:
        metadata: Its footer.
        table: The table whose rows it holds.
        names: The columns to read.

    Raises:
        OSError: It has no such column.
    """

    def __init__(self, metadata: pq.FileMetaData, table: Table, names: Sequence[str]) -> None:
        self.metadata = metadata
        places = {metadata.schema.column(index).path: index for index in range(metadata.num_columns)}
        missing = [name for name in names if table.column(name).path not in places]
        if missing:
            raise OSError(f"it has no column {missing[0]}")
        self._columns = [(places[column.path], _known(column)) for column in map(table.column, names)]
        self._chunks: dict[int, Array] = {}

    def num_rows(self, number: int) -> int:
        """Rows of a row group."""
        return int(self.metadata.row_group(number).num_rows)

    def span(self, number: int) -> tuple[int, int]:
        """Where the bytes of a row group's columns begin and end."""
        chunks = self.chunks(number)
        return int(chunks[:, kernels.CHUNK_START].min()), int(chunks[:, kernels.CHUNK_END].max())

    def chunks(self, number: int) -> Array:
        """(columns, 7) int64 where a row group's columns are, see ``page_kernels``."""
        if number not in self._chunks:
            group = self.metadata.row_group(number)
            columns = [_chunk(group.column(index), known) for index, known in self._columns]
            self._chunks[number] = np.array(columns, np.int64)
        return self._chunks[number]


def _chunk(chunk: pq.ColumnChunkMetaData, known: int) -> tuple[int, int, int, int, int, int, int]:
    data, size = chunk.data_page_offset, chunk.total_uncompressed_size
    start = min(data, chunk.dictionary_page_offset or data)
    codec = _CODECS.get(chunk.compression, kernels.OTHER_CODEC) if 0 <= size < _LARGEST else kernels.OTHER_CODEC
    end = start + chunk.total_compressed_size
    return start, data, end, chunk.num_values, codec, size if codec else 0, known


@dataclass(frozen=True, eq=False)
class RowGroup:
    """A row group with its bytes.

    Attributes:
        url: Its file, for errors.
        footer: Of its file.
        number: Its number in the file.
        content: (n,) uint8 read-only bytes of the file, its own among them.
        base: Where in the file they begin.
        open: Opens the file for Arrow.
    """

    url: str
    footer: Footer
    number: int
    content: Array
    base: int
    open: Callable[[], pq.ParquetFile]

    @property
    def num_rows(self) -> int:
        """Its rows."""
        return self.footer.num_rows(self.number)

    @property
    def chunks(self) -> Array:
        """Where its columns are, see :meth:`Footer.chunks`."""
        return self.footer.chunks(self.number)
