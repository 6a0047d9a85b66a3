"""Compiled loop of crops of shared maps."""

from __future__ import annotations

from scenarionet_data.arrays.dtypes import Array
from scenarionet_data.compiled.decorators import kernel


@kernel(nogil=True, allocates=False)
def move_points(offsets: Array, points: Array, rows: Array, shift: Array, moved_offsets: Array, moved: Array) -> None:
    """Choose lists of points, and move each by its shift.

    Args:
        offsets, points: (M + 1,) int32 and (P, 3) float32 [m], see ``Ragged``.
        rows: (n,) int64 the chosen lists.
        shift: (n, 3) float64 [m].
        moved_offsets: (n + 1,) int32 offsets of the chosen lists.
        moved: (Q, 3) float32 [m], filled; sums are computed in float64.
    """
    for row in range(len(rows)):
        first = offsets[rows[row]]
        source = points[first : offsets[rows[row] + 1]]
        target = moved[moved_offsets[row] : moved_offsets[row + 1]]
        for point in range(len(target)):
            for axis in range(3):
                target[point, axis] = source[point, axis] + shift[row, axis]
