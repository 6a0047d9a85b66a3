"""A uniform grid over boxes in the plane, to look up the boxes near a point."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from scenarionet_data.arrays.dtypes import Float32, Float64, Int32
from scenarionet_data.compiled.decorators import kernel

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

    @classmethod
    def over(cls, lower: Float32, upper: Float32, cell: float = CELL) -> Grid:
        """Return the grid over boxes.

        Args:
            lower, upper: (B, 2) float32 corners [m]; NaN for an empty box.
            cell: Side of a cell [m].
        """
        origin, end = np.zeros(2, np.float32), np.zeros(2, np.float32)
        if not np.isnan(lower[:, 0]).all():
            origin = np.floor(np.nanmin(lower, axis=0) / cell).astype(np.float32) * np.float32(cell)
            end = np.nanmax(upper, axis=0)
        size = cell
        while np.prod(np.floor((end - origin).astype(np.float64) / size) + 1) > _MAX_CELLS:
            size *= 2.0
        columns, rows = (int(cells) for cells in np.floor((end - origin) / size) + 1)
        frame = np.array([*origin, size, columns, rows], np.float64)
        first, last = np.empty((2, *lower.shape), np.int32)
        start = np.zeros(columns * rows + 1, np.int32)
        items = np.empty(_find_cells(lower, upper, frame, first, last), np.int32)
        _fill_cells(first, last, columns, start, items)
        return cls(frame, start, items)


@kernel(allocates=False)
def _find_cells(lower: Float32, upper: Float32, frame: Float64, first: Int32, last: Int32) -> int:
    """Find the first and last column and row (B, 2) that each box touches; none for an empty box.

    Returns:
        The sum over boxes of the cells that each touches.
    """
    total = 0
    for b in range(len(lower)):
        cells = 1
        for axis in range(2):
            most = int(frame[3 + axis]) - 1
            if math.isnan(lower[b, 0]):
                first[b, axis], last[b, axis] = 0, -1
            else:
                first[b, axis] = min(max(math.floor((lower[b, axis] - frame[axis]) / frame[2]), 0), most)
                last[b, axis] = min(max(math.floor((upper[b, axis] - frame[axis]) / frame[2]), 0), most)
            cells *= last[b, axis] - first[b, axis] + 1
        total += cells
    return total


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
