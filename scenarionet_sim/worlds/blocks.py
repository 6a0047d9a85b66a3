"""Arrays of rows in which blocks are stored and removed."""

from __future__ import annotations

from bisect import insort
from collections import deque
from collections.abc import Mapping

import numpy as np
import numpy.typing as npt

from scenarionet_data.arrays.dtypes import Array

_GROWTH, _FEWEST = 1.5, 16
"""Factor by which full arrays grow, and number of blocks like the next one for which they do at least; memory that was
never written to costs nothing."""

_REMEMBERED = 256
"""Number of blocks in ``Blocks.last_put``."""


class Blocks:
    """Arrays with one row axis in common, in which blocks of rows are stored one after another.

    Rows of removed blocks are used again. Arrays are replaced when they grow, rows never move.

    Args:
        columns: Dtype of each array, or dtype and shape of its rows.

    Attributes:
        arrays: The arrays by name, (R,) or (R, *shape).
        num_put: Number of blocks that were ever stored.
        last_put: First rows and ends of the last of them, for copies of the arrays elsewhere.
    """

    def __init__(self, columns: Mapping[str, npt.DTypeLike | tuple[npt.DTypeLike, *tuple[int, ...]]]) -> None:
        parts = {name: column if isinstance(column, tuple) else (column,) for name, column in columns.items()}
        self.arrays: dict[str, Array] = {name: np.empty((0, *shape), dtype) for name, (dtype, *shape) in parts.items()}
        self.num_put = 0
        self.last_put: deque[tuple[int, int]] = deque(maxlen=_REMEMBERED)
        self._num_rows = 0
        self._gaps: list[tuple[int, int]] = []  # first row and end of free rows, in order

    def put(self, values: Mapping[str, Array]) -> tuple[int, int]:
        """Store a block, one array per column; return its first row and its end; zeros follow shorter arrays."""
        count = max(map(len, values.values()))
        room = next((gap for gap in self._gaps if gap[1] - gap[0] >= count), None)
        if room is None:
            is_tail_free = bool(self._gaps) and self._gaps[-1][1] == self._num_rows
            used = self._gaps.pop()[0] if is_tail_free else self._num_rows
            self._num_rows = max(used + _FEWEST * count, int(_GROWTH * self._num_rows))
            for name, old in self.arrays.items():
                self.arrays[name] = np.empty((self._num_rows, *old.shape[1:]), old.dtype)
                self.arrays[name][:used] = old[:used]
            room = used, self._num_rows
            self._gaps.append(room)
        start, end = room[0], room[0] + count
        place = self._gaps.index(room)
        self._gaps[place : place + 1] = [(end, room[1])] if room[1] > end else []
        for name, rows in values.items():
            self.arrays[name][start : start + len(rows)] = rows
            if len(rows) < count:
                self.arrays[name][start + len(rows) : end] = 0
        self.num_put += 1
        self.last_put.append((start, end))
        return start, end

    def remove(self, start: int, end: int) -> None:
        """Free the rows of a block."""
        if start == end:
            return
        insort(self._gaps, (start, end))
        joined = self._gaps[:1]
        for first, last in self._gaps[1:]:
            if first == joined[-1][1]:
                joined[-1] = joined[-1][0], last
            else:
                joined.append((first, last))
        self._gaps = joined
