"""Sorting boxes into the cells of a uniform grid."""

from __future__ import annotations

from scenarionet_data.arrays.compiled import kernel
from scenarionet_data.arrays.dtypes import Int32


@kernel
def fill_cells(first: Int32, last: Int32, columns: int, start: Int32, items: Int32) -> None:
    """Write which boxes lie in which cell, in two calls: the first counts, the second writes.

    Args:
        first, last: (K, 2) int32 column and row of each box's lowest and highest cell; ``last`` is included,
            and below ``first`` for a box that lies nowhere.
        columns: Number of columns of the grid.
        start: (C + 1,) int32. An empty ``items`` asks to count: ``start[c + 1]`` becomes the number of boxes in
            cell c. Otherwise ``start[c]`` is where cell c begins in ``items``, and moves to its end.
        items: (sum of counts,) int32 box numbers, ascending within a cell.
    """
    is_counting = items.size == 0
    for box in range(first.shape[0]):
        for row in range(first[box, 1], last[box, 1] + 1):
            for column in range(first[box, 0], last[box, 0] + 1):
                cell = row * columns + column
                if is_counting:
                    start[cell + 1] += 1
                else:
                    items[start[cell]] = box
                    start[cell] += 1
