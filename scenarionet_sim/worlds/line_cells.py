"""Cells of the grid over a map's lines, packed as rays read them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from scenarionet_data.arrays.dtypes import Int32, UInt8
from scenarionet_sim.kernels.rays import LINE_BITS
from scenarionet_sim.kernels.structures import CELLS_IN_BLOCK
from scenarionet_sim.roads.grid import Grid


@dataclass(frozen=True, eq=False)
class LineCells:
    """C cells, F of them filled, in blocks; counted from 0, otherwise as in ``kernels.structures.Lines``.

    Attributes:
        cell_types: (C,) uint8.
        cell_rank: (C,) uint8.
        block_start: (C / 256, rounded up) int32.
        filled_start: (F + 1,) int32.
    """

    cell_types: UInt8
    cell_rank: UInt8
    block_start: Int32
    filled_start: Int32

    @classmethod
    def of(cls, grid: Grid, segment_type: UInt8) -> LineCells:
        """Pack a grid; ``segment_type`` (K,) is the type of each of its items."""
        start = grid.cell_start
        is_filled = start[1:] > start[:-1]
        filled = np.flatnonzero(is_filled)
        types = np.zeros(len(is_filled), np.uint8)
        if len(filled):
            types[filled] = np.bitwise_or.reduceat(LINE_BITS[segment_type], start[filled])
        before = np.cumsum(is_filled, dtype=np.int32) - is_filled
        block_start = before[::CELLS_IN_BLOCK]
        rank = before - np.repeat(block_start, CELLS_IN_BLOCK)[: len(before)]
        filled_start = np.append(start[filled], start[-1:])
        return cls(types, rank.astype(np.uint8), block_start.astype(np.int32), filled_start)
