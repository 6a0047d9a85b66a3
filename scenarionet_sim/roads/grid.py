"""A uniform grid over boxes in the plane, to look up the boxes near a point."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from scenarionet_data.arrays.compiled import kernel
from scenarionet_data.arrays.dtypes import Float32, Float64, Int32

CELL = 10.0
"""Side of a cell [m], unless another is given."""

_MAX_CELLS = 1 << 18
"""A map that would need more cells, because of a distant feature, gets larger cells."""


@dataclass(frozen=True, eq=False)
class Grid:
    """Boxes sorted into cells; cell (column, row) has the number ``row * columns + column``.

    Attributes:
        frame: (5,) float64 x, y of the lower left corner and side of a cell [m], scenario frame; numbers of columns
            and rows, at least one each.
        cell_start: (C + 1,) int32; cell c holds ``cell_items[cell_start[c]:cell_start[c + 1]]``.
        cell_items: (K,) int32 rows of the boxes that touch the cell, ascending.
    """

    frame: Float64
    cell_start: Int32
    cell_items: Int32

    @property
    def origin(self) -> Float64:
        """(2,) lower left corner of cell (0, 0) [m]."""
        return self.frame[:2]

    @property
    def cell_size(self) -> float:
        """Side of a cell [m]."""
        return float(self.frame[2])

    @property
    def shape(self) -> Int32:
        """(2,) int32 columns, rows."""
        return self.frame[3:].astype(np.int32)

    @classmethod
    def over(cls, lower: Float32, upper: Float32, cell: float = CELL) -> Grid:
        """Return the grid over boxes.

        Args:
            lower, upper: (B, 2) float32 corners [m]; NaN for an empty box.
            cell: Side of a cell [m].
        """
        exists = ~np.isnan(lower[:, 0])
        origin, end = np.zeros(2, np.float32), np.zeros(2, np.float32)
        if exists.any():
            origin = np.floor(lower[exists].min(axis=0) / cell).astype(np.float32) * np.float32(cell)
            end = upper[exists].max(axis=0)
        size = cell
        while np.prod(np.floor((end - origin).astype(np.float64) / size) + 1) > _MAX_CELLS:
            size *= 2.0
        shape = np.floor((end - origin) / size).astype(np.int32) + 1
        first, last = _cells(lower, origin, size, shape), _cells(upper, origin, size, shape)
        last[~exists] = first[~exists] - 1
        start = np.zeros(int(shape.prod()) + 1, np.int32)
        items = np.empty(int((last - first + 1).prod(axis=1).sum()), np.int32)
        _fill_cells(first, last, int(shape[0]), start, items)
        return cls(np.array([*origin, size, *shape], np.float64), start, items)


@kernel(allocates=False)
def _fill_cells(first: Int32, last: Int32, columns: int, start: Int32, items: Int32) -> None:
    """Sort boxes into cells, given the first and last column and row (B, 2) that each touches; see ``Grid``."""
    for b in range(len(first)):
        for row in range(first[b, 1], last[b, 1] + 1):
            for column in range(first[b, 0], last[b, 0] + 1):
                start[row * columns + column + 1] += 1
    for cell in range(1, len(start)):
        start[cell] += start[cell - 1]
    for b in range(len(first) - 1, -1, -1):  # backwards: the boxes of a cell end where those of the next begin
        for row in range(first[b, 1], last[b, 1] + 1):
            for column in range(first[b, 0], last[b, 0] + 1):
                start[row * columns + column + 1] -= 1
                items[start[row * columns + column + 1]] = b
    total = len(items)
    for cell in range(len(start) - 1):
        start[cell] = start[cell + 1]
    start[len(start) - 1] = total


def _cells(points: Float32, origin: Float32, size: float, shape: Int32) -> Int32:
    """Return column and row (B, 2) of each point, clipped to the grid."""
    cells = np.floor((np.nan_to_num(points).astype(np.float64) - origin) / size).astype(np.int32)
    inside: Int32 = np.clip(cells, 0, shape - 1)
    return inside
