"""Footers of Parquet files, and row groups with their bytes."""

from __future__ import annotations

import io
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
from xxhash import xxh3_128_digest

from scenarionet_data.arrays.columns import ColumnLayout, ColumnType
from scenarionet_data.arrays.dtypes import Array, Int64
from scenarionet_data.storage.read.parquet import page_kernels as kernels
from scenarionet_data.storage.read.parquet.reservation import Reservation

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
"""Encodings that the kernels decode, one bit each, by type."""
_PHYSICAL = {
    "bool": "BOOLEAN",
    "int8": "INT32",
    "int32": "INT32",
    "int64": "INT64",
    "uint64": "INT64",
    "float32": "FLOAT",
    "float64": "DOUBLE",
    "string": "BYTE_ARRAY",
    "json": "BYTE_ARRAY",
    "dictionary": "BYTE_ARRAY",
}
_ENCODINGS = {
    "RLE_DICTIONARY": kernels.INDICES,
    "BYTE_STREAM_SPLIT": kernels.BYTE_STREAM_SPLIT,
    "DELTA_BINARY_PACKED": 5,
    "DELTA_LENGTH_BYTE_ARRAY": 6,
    "DELTA_BYTE_ARRAY": 7,
}
"""Encodings of data pages other than PLAIN, by the names of pyarrow; columns with one of them list PLAIN as well."""
_PACKED = ("bool", "dictionary")
"""Types of which a value takes less than a byte."""
_MAX_CHUNK = 2**30
"""Bytes of a column chunk that the kernels read; larger ones are left to Arrow."""


class UnreadableFile(OSError):
    """Bytes of a Parquet file cannot be decoded.

    Attributes:
        url: The file.
    """

    def __init__(self, url: str, reason: str) -> None:
        super().__init__(reason)
        self.url = url


class StoredGroup(NamedTuple):
    """How a row group is stored.

    Attributes:
        chunks: (columns, NUM_CHUNK_FIELDS) its column chunks, see ``page_kernels``; 0 for missing columns.
        num_rows: Number of its rows.
        can_decode: Whether the kernels can decode all columns.
        largest: Bytes of the largest page at most.
        scratch: Bytes that its pages need while they are decoded: one at a time, but all of those in zstd together.
        span: Start and end of its bytes in the file, of which the digest is, or of its columns if there is none.
    """

    chunks: Int64
    num_rows: int
    can_decode: bool
    largest: int
    scratch: int
    span: tuple[int, int]

    @classmethod
    def of(cls, chunks: Int64, num_rows: int, span: tuple[int, int]) -> StoredGroup:
        """Those of some chunks."""
        present = chunks[chunks[:, kernels.CHUNK_END] > 0]
        sizes, is_zstd = present[:, kernels.CHUNK_SIZE], present[:, kernels.CODEC] == kernels.ZSTD
        largest = int(sizes.max(initial=0))
        can_decode = bool(present[:, kernels.CAN_DECODE].all())
        scratch = largest + int(sizes[is_zstd].sum()) + kernels.SPARE
        return cls(chunks, num_rows, can_decode, largest, scratch, span)


class Footer:
    """A file's footer, and the positions of some of its columns.

    Args:
        url: The file, for errors.
        metadata: Its footer.
        layout: The columns to read; nullable ones may be missing.
        digests: XXH3-128 of each row group; empty if there are none.
        end: Where the last row group ends.

    Raises:
        UnreadableFile: A required column is missing.
    """

    def __init__(
        self, url: str, metadata: pq.FileMetaData, layout: ColumnLayout, digests: Sequence[bytes] = (), end: int = 0
    ) -> None:
        columns = layout.columns
        self.url = url
        self.metadata = metadata
        self.digests = digests
        self._end = end
        positions = {metadata.schema.column(index).path: index for index in range(metadata.num_columns)}
        group = metadata.row_group(0) if metadata.num_row_groups else None
        self.names = [column.name for column in columns]
        self._columns: list[tuple[int | None, int, bool, int]] = []
        missing = set()
        for column in columns:
            index, encoding = positions.get(column.path), kernels.PLAIN
            if index is None:
                missing.add(column.name)
                if not column.nullable:
                    raise UnreadableFile(url, f"it has no column {column.name}")
            elif not _holds(metadata.schema.column(index), column):
                raise UnreadableFile(url, f"its column {column.name} has another type")
            elif group:  # a writer chooses the encoding of data pages for a file
                named = [_ENCODINGS[name] for name in group.column(index).encodings if name in _ENCODINGS]
                encoding = next(iter(named), encoding)
            self._columns.append((index, _known_encodings(column), column.element in _PACKED, encoding))
        self.missing = frozenset(missing)
        self._layout = layout
        self._stored: dict[int, StoredGroup] = {}
        self._reserved: dict[int, Reservation] = {}

    def _span(self, number: int, chunks: Int64) -> tuple[int, int]:
        """Start and end of the bytes of a row group, or of its columns in a file without digests."""
        if not self.digests:
            present = chunks[:, kernels.CHUNK_END] > 0
            return int(chunks[present, kernels.CHUNK_START].min()), int(chunks[:, kernels.CHUNK_END].max())
        bounds = []
        for group in (number, number + 1):
            column = self.metadata.row_group(group).column(0) if 0 < group < len(self.digests) else None
            first = column and min(column.data_page_offset, column.dictionary_page_offset or column.data_page_offset)
            bounds.append(first or (self._end if group else 0))
        return bounds[0], bounds[1]

    def stored(self, number: int) -> StoredGroup:
        """How a row group is stored.

        Raises:
            UnreadableFile: There is no such row group.
        """
        if number not in self._stored:
            if not 0 <= number < self.metadata.num_row_groups:
                raise UnreadableFile(self.url, f"it has no row group {number}")
            group = self.metadata.row_group(number)
            chunks = np.array([_chunk(group, *column) for column in self._columns], np.int64)
            self._stored[number] = StoredGroup.of(chunks, group.num_rows, self._span(number, chunks))
        return self._stored[number]

    def reserve(self, number: int) -> Reservation:
        """Places in memory of a row group's values."""
        if number not in self._reserved:
            stored = self.stored(number)
            self._reserved[number] = Reservation.of(self._layout, stored.chunks, stored.num_rows)
        return self._reserved[number]


def _holds(stored: pq.ColumnSchema, column: ColumnType) -> bool:
    """Whether a stored column has the type of a declared one."""
    levels = (stored.max_repetition_level, stored.max_definition_level)
    return bool(
        stored.physical_type == _PHYSICAL[column.element]
        and levels == (column.is_list, column.is_list + column.nullable)
    )


def _known_encodings(column: ColumnType) -> int:
    # Nullable integers become floats; no table that is loaded has them.
    is_float = column.element == "int32" and column.nullable and not column.is_list
    return 0 if is_float else _KNOWN.get(column.element, 0)


def _chunk(
    group: pq.RowGroupMetaData, index: int | None, known: int, is_packed: bool, encoding: int
) -> tuple[int, ...]:
    if index is None:
        return (0,) * kernels.NUM_CHUNK_FIELDS
    chunk = group.column(index)
    data, size = chunk.data_page_offset, chunk.total_uncompressed_size
    start = min(data, chunk.dictionary_page_offset or data)
    codec = _CODECS.get(chunk.compression, kernels.OTHER_CODEC) if 0 <= size < _MAX_CHUNK else kernels.OTHER_CODEC
    end = start + chunk.total_compressed_size
    can_decode = known >> encoding & 1 if codec != kernels.OTHER_CODEC else 0
    # Not what an unverified number of values says: other values take four bytes or more.
    room = max(chunk.num_values if is_packed else min(chunk.num_values, size // 4), 0) * can_decode
    return start, data, end, chunk.num_values, codec, size, encoding, can_decode, room


class RowGroup(NamedTuple):
    """A row group with its bytes.

    Attributes:
        footer: Footer of the file.
        number: Number of the row group in the file.
        content: (n,) uint8 read-only bytes of the file that contain the row group.
        base: Position of these bytes in the file.
    """

    footer: Footer
    number: int
    content: Array
    base: int = 0

    @property
    def num_rows(self) -> int:
        """Number of rows."""
        return self.footer.stored(self.number).num_rows

    def verify(self) -> None:
        """Compare the bytes with their digest, if there is one.

        Raises:
            UnreadableFile: They differ.
        """
        footer = self.footer
        if footer.digests:
            start, end = footer.stored(self.number).span
            if xxh3_128_digest(self.content.data[start - self.base : end - self.base]) != footer.digests[self.number]:
                raise UnreadableFile(footer.url, "its bytes differ from those that were written")

    def open(self) -> pq.ParquetFile:
        """Open the bytes with Arrow; other row groups that they contain can be read, too."""
        source = pa.PythonFile(_Window(self.content, self.base), "r") if self.base else pa.BufferReader(self.content)
        return pq.ParquetFile(
            source,
            metadata=self.footer.metadata,
            pre_buffer=False,
        )


class _Window(io.RawIOBase):
    """A file of which only a range of bytes is in memory."""

    def __init__(self, content: Array, base: int) -> None:
        self._content, self._base = content, base
        self._position = 0

    def readable(self) -> bool:
        """Always True; required by io.RawIOBase."""
        return True

    def seekable(self) -> bool:
        """Always True; required by io.RawIOBase."""
        return True

    def tell(self) -> int:
        """Current position in the file."""
        return self._position

    def seek(self, offset: int, whence: int = io.SEEK_SET) -> int:
        """Change the position; the end of the file is the end of the range."""
        end = self._base + len(self._content)
        self._position = offset + {io.SEEK_SET: 0, io.SEEK_CUR: self._position, io.SEEK_END: end}[whence]
        return self._position

    def read(self, size: int = -1) -> bytes:
        """Read bytes at the current position."""
        start = self._position - self._base
        if start < 0 or size < 0 or start + size > len(self._content):
            raise OSError("a column chunk exceeds its row group")
        self._position += size
        return bytes(self._content[start : start + size])
