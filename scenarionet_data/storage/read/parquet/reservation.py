"""Places in memory of the values of row groups."""

from __future__ import annotations

from typing import NamedTuple, Self

import numpy as np

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
from scenarionet_data.arrays.dtypes import Bool, Int64
from scenarionet_data.arrays.memory import Memory
from scenarionet_data.storage.read.parquet import page_kernels as pages


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
        room = np.where(layout.are_lists, chunks[:, pages.CHUNK_ROOM], num_rows)
        lengths = (2 * num_rows + 1) * np.arange(count)
        sizes = shape.widths * (room + shape.are_texts)  # of texts, the start of the first one as well
        start = _aligned(4 * (2 * num_rows + 1) * count)
        ends, num_bytes = start + sizes[order].cumsum(), shape.have_bytes * chunks[:, pages.CHUNK_SIZE]
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
