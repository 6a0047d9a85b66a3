"""A uniform grid over boxes in the plane: which of them may touch a place, without looking at the others."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from scenarionet_data.arrays.dtypes import Float32, Int32
from scenarionet_sim.kernels.cells import fill_cells

CELL = 10.0
"""Side of a cell [m]."""

_MAX_CELLS = 1 << 18
"""A map that would need more, because one feature lies far away, gets larger cells."""


@dataclass(frozen=True, eq=False)
class Grid:
    """Boxes sorted into cells; cell (column, row) has the number ``row * columns + column``.

    Attributes:
        origin: (2,) float32 [m] lower left corner of cell (0, 0), scenario frame.
        shape: (2,) int32 columns, rows; at least one each.
        cell_size: Side of a cell [m].
        cell_start: (C + 1,) int32; cell c holds ``cell_items[cell_start[c]:cell_start[c + 1]]``.
        cell_items: (K,) int32 rows of the boxes that touch the cell, ascending.
    """

    origin: Float32
    shape: Int32
    cell_size: float
    cell_start: Int32
    cell_items: Int32

    @classmethod
    def over(cls, lower: Float32, upper: Float32) -> Grid:
        """The grid of boxes given by their corners.

        Args:
            lower, upper: (B, 2) float32 [m]; NaN for a box that lies nowhere.
        """
        is_somewhere = ~np.isnan(lower[:, 0])
        origin, end = np.zeros(2, np.float32), np.zeros(2, np.float32)
        if is_somewhere.any():
            origin = np.floor(lower[is_somewhere].min(axis=0) / CELL).astype(np.float32) * np.float32(CELL)
            end = upper[is_somewhere].max(axis=0)
        size = _cell_size(origin, end)
        shape = np.floor((end - origin) / size).astype(np.int32) + 1
        first, last = _cells(lower, origin, size, shape), _cells(upper, origin, size, shape)
        last[~is_somewhere] = -1
        counts = np.zeros(int(shape.prod()) + 1, np.int32)
        fill_cells(first, last, int(shape[0]), counts, np.zeros(0, np.int32))
        start = np.cumsum(counts, dtype=np.int32)
        items = np.empty(start[-1], np.int32)
        if len(items):
            fill_cells(first, last, int(shape[0]), start.copy(), items)
        return cls(origin, shape, size, start, items)


def _cell_size(origin: Float32, end: Float32) -> float:
    size = CELL
    while np.prod(np.floor((end - origin).astype(np.float64) / size) + 1) > _MAX_CELLS:
        size *= 2.0
    return size


def _cells(points: Float32, origin: Float32, size: float, shape: Int32) -> Int32:
    """(B, 2) column and row of each point, moved onto the grid."""
    cells = np.floor((np.nan_to_num(points).astype(np.float64) - origin) / size).astype(np.int32)
    inside: Int32 = np.clip(cells, 0, shape - 1)
    return inside
