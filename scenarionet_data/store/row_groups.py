"""Row groups of one open file of the lake: lists of floats without Arrow, the rest with it.

Lists of floats are the bulk of a scenario. Arrow sets up a decompressor for every column (20-40 us) and rebuilds
the same list lengths for each; here one decompressor serves all of them and a compiled loop does the rest. Only
what our own writer makes is read this way (zstd, data pages of version 1, BYTE_STREAM_SPLIT).
"""

from __future__ import annotations

import mmap
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import pyarrow.parquet as pq
import zstandard

from scenarionet_data.codec import LoadedRows
from scenarionet_data.store import page_kernels as kernels
from scenarionet_data.tables import Column, Table

Array = npt.NDArray[Any]

_DATA_PAGE, _BYTE_STREAM_SPLIT = 0, 9
_ENCODINGS = {"RLE", "BYTE_STREAM_SPLIT"}
_NOTHING: Array = np.frombuffer(b"", np.uint8)  # read-only as pages are: kernels are compiled for each kind of array


class RowGroups:
    """One open file; for one thread at a time.

    Args:
        file: The file.
        content: Its bytes; those of row groups that are not read may be missing.
        columns: Names of the columns to read.
        lists: Those of them that are float lists, of :func:`list_columns`.
    """

    def __init__(
        self, file: pq.ParquetFile, content: memoryview, columns: Sequence[str], lists: Sequence[tuple[int, Column]]
    ) -> None:
        self._file = file
        self._columns = columns
        self._lists = lists
        self._content = content
        self._bytes = np.frombuffer(content, np.uint8)
        self._zstd = zstandard.ZstdDecompressor()

    @classmethod
    def open(cls, path: Path, table: Table, columns: Sequence[str]) -> RowGroups:
        """Those of a file on this machine.

        Raises:
            SchemaMismatch: It is of another version of the table.
        """
        # pre_buffer would share its cache between threads; a memory map needs no copy.
        opened = pq.ParquetFile(path, memory_map=True, pre_buffer=False)
        table.check_version(opened.metadata.metadata, str(path))
        with path.open("rb") as file:
            content = memoryview(mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ))
        return cls(opened, content, columns, list_columns(opened.metadata, table, columns))

    def close(self) -> None:
        """Close the file."""
        self._file.close()

    def read(self, number: int) -> LoadedRows:
        """Row group ``number``.

        Raises:
            OSError: A page is damaged.
        """
        group, lists = self._file.metadata.row_group(number), {}
        for index, column in self._lists:
            found = self._read_lists(group.column(index), column)
            if found is not None:
                lists[column.name] = found
        others = [name for name in self._columns if name not in lists]
        rows = self._file.read_row_group(number, others, use_threads=False)
        (batch,) = rows.combine_chunks().to_batches()
        return LoadedRows(batch, lists)

    def _read_lists(self, chunk: pq.ColumnChunkMetaData, column: Column) -> tuple[Array, Array] | None:
        """Lengths and values of a column; None when Arrow must read it."""
        if chunk.compression != "ZSTD" or set(chunk.encodings) != _ENCODINGS:
            return None
        start, stored, size, kind, count, encoding = kernels.read_header(self._bytes, chunk.data_page_offset)
        if (kind, encoding, count) != (_DATA_PAGE, _BYTE_STREAM_SPLIT, chunk.num_values):  # more than one page
            return None
        lengths, values = np.empty(count, np.int32), np.empty(count, np.float32)
        page = self._decompress(start, start + stored, size)
        rows, elements = kernels.read_lists(page, count, column.nullable, lengths, values)
        if rows == kernels.UNKNOWN:
            raise OSError(f"column {column.name} is damaged")
        return lengths[:rows], values[:elements]

    def _decompress(self, start: int, end: int, size: int) -> Array:
        """An uncompressed page of ``size`` bytes; empty when it is damaged."""
        stored = self._content[start:end]
        try:
            # Asked first, so that a damaged header cannot ask for a terabyte.
            if zstandard.frame_content_size(stored) != size:
                return _NOTHING
            return np.frombuffer(self._zstd.decompress(stored), np.uint8)
        except zstandard.ZstdError:
            return _NOTHING


def list_columns(footer: pq.FileMetaData, table: Table, names: Sequence[str]) -> list[tuple[int, Column]]:
    """Columns of float lists among ``names``, and their numbers in the file."""
    wanted = {table.column(name).path: table.column(name) for name in names}
    paths = [footer.schema.column(index).path for index in range(footer.num_columns)]
    return [
        (index, wanted[path])
        for index, path in enumerate(paths)
        if path in wanted and wanted[path].type == "list<float32>"
    ]
