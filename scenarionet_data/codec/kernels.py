"""The loops that every load and every conversion runs, compiled. They trust their arguments."""

from __future__ import annotations

from typing import Any

import numpy.typing as npt
from numba import njit

Array = npt.NDArray[Any]


@njit(cache=True)
def fill(block: Array, axis: int, start: Array, lengths: Array, values: Array) -> None:
    """Put each object's list where its span is: ``block[i, start[i] + k, axis]`` is list ``i``'s element ``k``.

    Args:
        block: (N, T, D) float32, filled.
        axis: Which of the D.
        start: (N,) int32 timestep of each list's first element.
        lengths: (N,) int32.
        values: (sum of lengths,) float32.
    """
    at = 0
    for row in range(len(lengths)):
        for step in range(start[row], start[row] + lengths[row]):
            block[row, step, axis] = values[at]
            at += 1


@njit(cache=True)
def fill_sizes(block: Array, axis: int, valid: Array, start: Array, lengths: Array, values: Array) -> None:
    """Like :func:`fill` at the valid steps alone, where a list of one element holds at all of them.

    Args:
        block: (N, T, D) float32, filled.
        axis: Which of the D.
        valid: (N, T) bool.
        start: (N,) int32 timestep of each span's first element; nothing is valid before it.
        lengths: (N,) int32: 1, or the object's span.
        values: (sum of lengths,) float32.
    """
    first = 0
    for row in range(len(lengths)):
        step_size = 0 if lengths[row] == 1 else 1
        for step in range(start[row], valid.shape[1]):
            if valid[row, step]:
                block[row, step, axis] = values[first + step_size * (step - start[row])]
        first += lengths[row]


@njit(cache=True)
def fill_valid(valid: Array, start: Array, lengths: Array, has_gaps: Array, flags: Array) -> None:
    """Which steps of each span are valid: all of them, or what the flags say.

    Args:
        valid: (N, T) bool, filled.
        start, lengths: (N,) int32 spans.
        has_gaps: (N,) bool whether there are flags for the object.
        flags: Flags of those objects' spans, one after the other.
    """
    at = 0
    for row in range(len(lengths)):
        for step in range(start[row], start[row] + lengths[row]):
            valid[row, step] = flags[at] if has_gaps[row] else True
            at += has_gaps[row]


@njit(cache=True)
def find_bounds(offsets: Array, points: Array, bounds: Array) -> None:
    """Extend each row's box by the points of its list.

    Args:
        offsets: (M + 1,) int32, see ``Ragged``.
        points: (P, 3) float32.
        bounds: (M, 4) float32 min_x, min_y, max_x, max_y, extended; NaN where there is no point yet.
    """
    for row in range(len(offsets) - 1):
        for point in range(offsets[row], offsets[row + 1]):
            for axis in range(2):
                value = points[point, axis]
                # "not >=" rather than "<": the first point replaces NaN.
                if not value >= bounds[row, axis]:
                    bounds[row, axis] = value
                if not value <= bounds[row, axis + 2]:
                    bounds[row, axis + 2] = value
