"""Places in memory of the values of row groups."""

from __future__ import annotations

from typing import NamedTuple, Self

import numpy as np

from scenarionet_data.arrays.columns import (
    BITS,
    INDICES,
    LIST,
    NULLABLE,
    TEXTS,
    ColumnBlock,
    ColumnLayout,
)
from scenarionet_data.arrays.dtypes import Int64
from scenarionet_data.arrays.memory import Memory
from scenarionet_data.storage.read.parquet import page_kernels as pages

_WIDEST = 8
"""Bytes of the widest elements."""


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
        kinds, count = np.array(layout.kinds, np.int64), len(layout.columns)
        shapes = [LIST * column.is_list + NULLABLE * column.nullable for column in layout.columns]
        room = np.where(layout.are_lists, chunks[:, pages.CHUNK_ROOM], num_rows)
        lengths = (2 * num_rows + 1) * np.arange(count + 1)
        widths = np.where(kinds == TEXTS, _WIDEST, np.where(kinds == BITS, 1, 4))
        sizes = widths * (room + (kinds == TEXTS))  # of texts, the start of the first one as well
        order = np.argsort(-widths, kind="stable")  # so that all are aligned
        ends = _aligned(4 * int(lengths[-1])) + np.cumsum([0, *sizes[order]])
        firsts = np.zeros(count, np.int64)
        firsts[order] = ends[:-1] // widths[order]
        num_bytes = np.where((kinds == TEXTS) | (kinds == INDICES), chunks[:, pages.CHUNK_SIZE], 0)
        last_bytes = ends[-1] + np.cumsum(num_bytes)
        of_lists, none = (lengths[:-1], lengths[:-1] + num_rows), np.zeros(count, np.int64)
        columns = [*of_lists, firsts, none, shapes, kinds, room, last_bytes - num_bytes, last_bytes]
        size = int(ends[-1] + num_bytes.sum())
        return cls(np.array(columns, np.int64).T.copy(), _aligned(size))

    def block(self, memory: Memory) -> ColumnBlock:
        """Memory for the values."""
        return ColumnBlock(self.columns.copy(), memory.bytes(self.size))


def _aligned(size: int) -> int:
    """The next multiple of the width of the widest elements."""
    return -(-size // _WIDEST) * _WIDEST
