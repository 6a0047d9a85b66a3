"""Places in memory of the values of row groups."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple, Self

import numpy as np

from scenarionet_data.arrays.columns import BITS, INDICES, TEXTS, ColumnBlock, ColumnLayout
from scenarionet_data.arrays.dtypes import Array, Int64
from scenarionet_data.arrays.memory import Memory
from scenarionet_data.storage.read.parquet import page_kernels as pages
from scenarionet_data.storage.read.parquet import value_kernels as values


class Reservation(NamedTuple):
    """Places of the values of C columns.

    Attributes:
        columns: (C, NUM_COLUMN_FIELDS) int64 the columns for kernels, see ``value_kernels``.
        firsts: (C,) int64, see ``ColumnBlock``.
        size: Bytes of memory.
        arrays: Shape, dtype and place in memory of each array of values.
    """

    columns: Int64
    firsts: Int64
    size: int
    arrays: Sequence[tuple[tuple[int, ...], type[np.generic], int]]

    @classmethod
    def of(cls, layout: ColumnLayout, chunks: Int64, num_rows: int) -> Self:
        """Places for row groups.

        Args:
            layout: The columns.
            chunks: (C, NUM_CHUNK_FIELDS) sum over the row groups, see ``page_kernels``.
            num_rows: Rows of them all.
        """
        kinds = np.array(layout.kinds)
        shapes = [pages.LIST * column.is_list + pages.NULLABLE * column.nullable for column in layout.columns]
        columns, firsts = np.zeros((len(kinds), values.NUM_COLUMN_FIELDS), np.int64), np.zeros(len(kinds), np.int64)
        room = np.where(layout.are_lists, chunks[:, pages.CHUNK_ROOM], num_rows)
        sizes = np.where((kinds == TEXTS) | (kinds == INDICES), chunks[:, pages.CHUNK_SIZE], 0)
        last_bytes = np.cumsum(sizes)
        columns[:] = np.column_stack([shapes, kinds, room, last_bytes - sizes, last_bytes])
        totals = []
        for stored in (kinds == TEXTS, kinds == BITS, (kinds != TEXTS) & (kinds != BITS)):
            counts = room[stored] + (kinds[stored] == TEXTS)  # of texts, the start of the first one as well
            firsts[stored] = np.cumsum(counts) - counts
            totals.append(int(counts.sum()))
        num_ends, num_bits, num_words = totals
        lists = 8 * num_ends  # the widest values first, so that all are aligned
        words = lists + 4 * 2 * len(kinds) * (num_rows + 1)
        bits = words + 4 * num_words
        text = bits + num_bits
        num_bytes = int(last_bytes[-1]) if len(kinds) else 0
        arrays = (
            ((2, len(kinds), num_rows + 1), np.int32, lists),
            ((num_words,), np.uint32, words),
            ((num_words,), np.float32, words),
            ((num_bits,), np.int8, bits),
            ((num_ends,), np.int64, 0),
            ((num_bytes,), np.uint8, text),
        )
        return cls(columns, firsts, text + num_bytes, arrays)

    def block(self, memory: Memory) -> ColumnBlock:
        """Memory for the values, without any yet."""
        whole = memory.bytes(self.size)
        lists, *others = [np.ndarray(shape, kind, whole, at) for shape, kind, at in self.arrays]
        counts: Array = np.zeros(len(self.firsts), np.int64)
        return ColumnBlock(lists, self.firsts, counts, *others)
