"""Footers of Parquet files, row groups with their bytes, and the places of their values in memory."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple, Self

import numpy as np
import pyarrow.parquet as pq

from scenarionet_data.arrays.columns import (
    BITS,
    FIRST,
    FIRST_BYTE,
    INDICES,
    KIND,
    LAST_BYTE,
    LENGTHS,
    LIST,
    NULLABLE,
    NUM_COLUMN_FIELDS,
    OFFSETS,
    ROOM,
    SHAPE,
    TEXTS,
    WIDEST,
    ColumnBlock,
    ColumnLayout,
)
from scenarionet_data.arrays.dtypes import Array, Bool, Int64
from scenarionet_data.arrays.memory import Memory
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


class Reservation(NamedTuple):
    """Places of the values of C columns.

    Attributes:
        columns: (C, NUM_COLUMN_FIELDS) int64, see ``ColumnBlock``; without any values yet.
        size: Bytes of memory, a multiple of all widths.
    """

    columns: Int64
    size: int

    @classmethod
    def of(cls, layout: ColumnLayout, chunks: Int64, num_rows: int) -> Self:
        """Places for row groups.

        Args:
            layout: The columns.
            chunks: (C, NUM_CHUNK_FIELDS) sum over the row groups, see ``page_kernels``.
            num_rows: Rows of them all.
        """
        shape = layout.derived.get(cls)
        if shape is None:
            shape = layout.derived[cls] = _Shape.of(layout)
        columns, order, count = shape.columns.copy(), shape.order, len(layout.columns)
        room = np.where(layout.are_lists, chunks[:, kernels.CHUNK_ROOM], num_rows)
        lengths = (2 * num_rows + 1) * np.arange(count)
        sizes = shape.widths * (room + shape.are_texts)  # of texts, the start of the first one as well
        start = _aligned(4 * (2 * num_rows + 1) * count)
        ends, num_bytes = start + sizes[order].cumsum(), shape.have_bytes * chunks[:, kernels.CHUNK_SIZE]
        first_bytes = start + int(sizes.sum()) + num_bytes.cumsum() - num_bytes
        columns[:, LENGTHS], columns[:, OFFSETS], columns[:, ROOM] = lengths, lengths + num_rows, room
        columns[order, FIRST] = (ends - sizes[order]) // shape.widths[order]
        columns[:, FIRST_BYTE], columns[:, LAST_BYTE] = first_bytes, first_bytes + num_bytes
        return cls(columns, _aligned(start + int(sizes.sum()) + int(num_bytes.sum())))

    def block(self, memory: Memory) -> ColumnBlock:
        """Memory for the values."""
        return ColumnBlock(self.columns.copy(), memory.bytes(self.size))


class _Shape(NamedTuple):
    """What reservations of a layout have in common.

    Attributes:
        columns: (C, NUM_COLUMN_FIELDS) int64 with SHAPE and KIND.
        widths: (C,) int64 bytes of a value.
        are_texts: (C,) bool.
        have_bytes: (C,) bool whether there are bytes of texts or dictionaries.
        order: (C,) int64 the columns, those of wide values first, so that all are aligned.
    """

    columns: Int64
    widths: Int64
    are_texts: Bool
    have_bytes: Bool
    order: Int64

    @classmethod
    def of(cls, layout: ColumnLayout) -> Self:
        """Those of a layout."""
        kinds = np.array(layout.kinds, np.int64)
        columns = np.zeros((len(kinds), NUM_COLUMN_FIELDS), np.int64)
        columns[:, SHAPE] = [LIST * column.is_list + NULLABLE * column.nullable for column in layout.columns]
        columns[:, KIND] = kinds
        are_texts = kinds == TEXTS
        widths = np.where(are_texts, WIDEST, np.where(kinds == BITS, 1, 4))
        return cls(columns, widths, are_texts, are_texts | (kinds == INDICES), np.argsort(-widths, kind="stable"))


def _aligned(size: int) -> int:
    """The next multiple of the width of the widest elements."""
    return -(-size // WIDEST) * WIDEST


class Footer:
    """A file's footer, and the positions of some of its columns.

    Args:
        url: The file, for errors.
        metadata: Its footer.
        layout: The columns to read; nullable ones may be missing.
        digests: XXH3-128 of each row group, which are compared when they are read; empty if there are none.
        end: Where the last row group ends.

    Attributes:
        present: Those of the columns that are not missing.

    Raises:
        UnreadableFile: A required column is missing.
    """

    def __init__(
        self, url: str, metadata: pq.FileMetaData, layout: ColumnLayout, digests: Sequence[bytes] = (), end: int = 0
    ) -> None:
        self.url, self.metadata, self.digests = url, metadata, digests
        self._layout, self._end = layout, end
        schema, positions = metadata.schema, dict[str, int]()
        for index in range(metadata.num_columns):
            positions[schema.column(index).path] = index
        group = metadata.row_group(0) if metadata.num_row_groups else None
        self._columns: list[tuple[int, int, bool, int]] = []
        self.present: list[str] = []
        for column in layout.columns:
            index, encoding = positions.get(column.path, -1), kernels.PLAIN
            if index < 0 and not column.nullable:
                raise UnreadableFile(url, f"it has no column {column.name}")
            if index >= 0:
                self.present.append(column.name)
                stored = schema.column(index)
                levels = stored.max_repetition_level, stored.max_definition_level
                wanted = column.is_list, column.is_list + column.nullable
                if stored.physical_type != _PHYSICAL[column.element] or levels != wanted:
                    raise UnreadableFile(url, f"its column {column.name} has another type")
                for name in reversed(group.column(index).encodings if group else ()):
                    encoding = _ENCODINGS.get(name, encoding)  # a writer chooses that of data pages for a file
            # Nullable integers become floats; no table that is loaded has them.
            is_float = column.element == "int32" and column.nullable and not column.is_list
            known = 0 if is_float else _KNOWN.get(column.element, 0)
            self._columns.append((index, known, column.element in _PACKED, encoding))
        self._stored: dict[int, StoredGroup] = {}
        self._reserved: dict[int, Reservation] = {}

    def stored(self, number: int) -> StoredGroup:
        """How a row group is stored.

        Raises:
            UnreadableFile: There is no such row group.
        """
        known = self._stored.get(number)
        if known is not None:
            return known
        if not 0 <= number < self.metadata.num_row_groups:
            raise UnreadableFile(self.url, f"it has no row group {number}")
        group = self.metadata.row_group(number)
        chunks = np.zeros((len(self._columns), kernels.NUM_CHUNK_FIELDS), np.int64)
        for place, (index, encodings, is_packed, encoding) in enumerate(self._columns):
            if index < 0:
                continue
            chunk = group.column(index)
            data, size, count = chunk.data_page_offset, chunk.total_uncompressed_size, chunk.num_values
            start = min(data, chunk.dictionary_page_offset or data)
            is_small = 0 <= size < _MAX_CHUNK
            codec = _CODECS.get(chunk.compression, kernels.OTHER_CODEC) if is_small else kernels.OTHER_CODEC
            can_decode = encodings >> encoding & 1 if codec != kernels.OTHER_CODEC else 0
            # Not what an unverified number of values says: other values take four bytes or more.
            room = max(count if is_packed else min(count, size // 4), 0) * can_decode
            end = start + chunk.total_compressed_size
            chunks[place] = start, data, end, count, codec, size, encoding, can_decode, room
        present = chunks[chunks[:, kernels.CHUNK_END] > 0]
        sizes, is_zstd = present[:, kernels.CHUNK_SIZE], present[:, kernels.CODEC] == kernels.ZSTD
        largest = int(sizes.max(initial=0))
        self._stored[number] = StoredGroup(
            chunks,
            group.num_rows,
            can_decode=bool(present[:, kernels.CAN_DECODE].all()),
            largest=largest,
            scratch=largest + int(sizes[is_zstd].sum()) + kernels.SPARE,
            span=self._span(number, present),
        )
        return self._stored[number]

    def _span(self, number: int, present: Int64) -> tuple[int, int]:
        """Start and end of the bytes of a row group, or of its columns in a file without digests."""
        if not self.digests:
            return int(present[:, kernels.CHUNK_START].min()), int(present[:, kernels.CHUNK_END].max())
        bounds = []
        for group in (number, number + 1):
            column = self.metadata.row_group(group).column(0) if 0 < group < len(self.digests) else None
            first = column and min(column.data_page_offset, column.dictionary_page_offset or column.data_page_offset)
            bounds.append(first or (self._end if group else 0))
        return bounds[0], bounds[1]

    def reserve(self, number: int) -> Reservation:
        """Places in memory of a row group's values."""
        if number not in self._reserved:
            stored = self.stored(number)
            self._reserved[number] = Reservation.of(self._layout, stored.chunks, stored.num_rows)
        return self._reserved[number]


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
