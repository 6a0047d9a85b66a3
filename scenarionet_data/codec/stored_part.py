"""Parts of a loaded scenario: their arrays are in one piece of memory, and become fields when they are read."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import accumulate
from operator import mul
from typing import Any, ClassVar

import numpy as np

from scenarionet_data.arrays.columns import Columns
from scenarionet_data.arrays.compiled import unchecked
from scenarionet_data.arrays.dtypes import Array, Object
from scenarionet_data.arrays.ragged import Ragged
from scenarionet_data.arrays.texts import Texts
from scenarionet_data.codec.text_kernels import copy_texts, measure_texts

STEPS = -1
"""The axis over time, in ``StoredPart.axes``."""


class StoredPart:
    """Fields of a part with M rows, in memory of their own, in which its texts are already.

    Args:
        columns: Rows.
        first, last: Those of the part.
        counts: Number of elements of each array but those of texts.
        steps: T, for arrays over time.

    Attributes:
        arrays: dtype of each array by name, in order: those of 4 bytes come first, so that all are aligned. Before them
            are the ends of texts and the numbers of texts, behind them the texts, see ``copy_texts``.
        axes: Axes behind M of arrays that have some.
        texts: Columns of texts by name of the field that they become.
        lists: Those of these fields that are lists of texts.
        has_gaps: Whether elements that no kernel writes are 0.
        length: M.
        memory: uint8, filled by a kernel.
        places: Start of each array in it, and end of the last one.
    """

    arrays: ClassVar[Mapping[str, type[np.generic]]]
    axes: ClassVar[Mapping[str, Sequence[int]]] = {}
    texts: ClassVar[Mapping[str, str]]
    lists: ClassVar[Sequence[str]] = ()
    has_gaps: ClassVar[bool] = False
    _kinds: ClassVar[Mapping[str, type[np.generic]]]
    _widths: ClassVar[tuple[int, ...]]
    _numbers: ClassVar[Mapping[str, int]]
    _columns: ClassVar[tuple[str, ...]]

    def __init_subclass__(cls) -> None:
        cls._kinds = {"text_ends": np.int64, "text_offsets": np.int32, **cls.arrays, "text": np.uint8}
        cls._widths = tuple(np.dtype(kind).itemsize for kind in cls._kinds.values())
        cls._numbers = {name: number for number, name in enumerate(cls._kinds)}
        cls._columns = tuple(cls.texts.values())

    def __init__(self, columns: Columns, first: int, last: int, counts: Sequence[int], steps: int = 0) -> None:
        layout, self.length, self._steps = columns.layout, last - first, steps
        described = columns.block, layout.places(self._columns), layout.are_lists, first, last
        num_texts, size = unchecked(measure_texts)(*described)
        offsets = len(self.texts) * (self.length + 1)
        of_texts = num_texts + len(self.texts), offsets
        self.places = tuple(accumulate(map(mul, self._widths, (*of_texts, *counts, size)), initial=0))
        total = (self.places[-1] + 7) // 8 * 8  # for kernels, which see it as an array of each width
        self.memory = np.zeros(total, np.uint8) if self.has_gaps else np.empty(total, np.uint8)
        unchecked(copy_texts)(*described, self.memory, (0, self.places[1], self.places[-2]))

    def array(self, name: str, *shape: int) -> Array:
        """An array with a shape."""
        return np.ndarray(shape, self._kinds[name], self.memory, self.places[self._numbers[name]])

    def __getitem__(self, field: str) -> Any:
        """Value of a field."""
        if field in self.texts:
            return self._text(field)
        axes = (self._steps if axis == STEPS else axis for axis in self.axes.get(field, ()))
        return self.array(field, self.length, *axes)

    def _text(self, field: str) -> Object | Ragged:
        """Texts or None of each row, or lists of texts."""
        ends, first = self.array("text_ends", self.places[1] // 8), 0
        for name, offsets in zip(self.texts, self.array("text_offsets", len(self.texts), self.length + 1), strict=True):
            count = offsets.item(-1) if name in self.lists else self.length
            if name == field:
                break
            first += count + 1
        texts = Texts(ends[first : first + count + 1], self.memory[self.places[-2] :])
        if field in self.lists:
            return Ragged(offsets.copy(), texts.strings())
        return Texts(texts.ends, texts.data, offsets[1:] == offsets[:-1]).strings()
