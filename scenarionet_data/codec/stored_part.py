"""Parts of a loaded scenario: their arrays are in one piece of memory, and become fields when they are read."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any, ClassVar

import numpy as np

from scenarionet_data.arrays.columns import ColumnLayout, Columns
from scenarionet_data.arrays.dtypes import Array, Int64, Object
from scenarionet_data.arrays.memory import Memory
from scenarionet_data.arrays.ragged import Ragged
from scenarionet_data.arrays.texts import Texts
from scenarionet_data.codec.part_kernels import ENDS, ROWS, PartPlan, lay_out
from scenarionet_data.compiled.checking import unchecked

STEPS = -1
"""The axis over time, in ``StoredPart.arrays``."""
_LENGTHS = {"rows": ROWS, "ends": ENDS}


class StoredPart:
    """Fields of a part with M rows, in memory of their own, which a kernel fills.

    Args:
        columns: Rows.
        first, last: Those of the part.
        steps: T.
        memory: Where to take theirs from.

    Attributes:
        arrays: dtype and axes of each array by name, in order: those of 4 bytes come first, so that all are aligned.
            The first axis is ``rows``; ``ends``, which is one more; or the elements of a column of lists. Before the
            arrays are the ends of texts and the numbers of texts, behind them the texts, see ``copy_texts``.
        texts: Columns of texts by name of the field that they become.
        lists: Those of these fields that are lists of texts.
        plan: What kernels know of this.
        length: M.
        memory: uint8, of any values.
        places: (arrays + 4,) int64 start of each array in it, and end of the last one.
    """

    arrays: ClassVar[Mapping[str, tuple[type[np.generic], str, tuple[int, ...]]]]
    texts: ClassVar[Mapping[str, str]]
    lists: ClassVar[Sequence[str]] = ()
    _numbers: ClassVar[Mapping[str, int]]

    def __init_subclass__(cls) -> None:
        cls._numbers = {name: number for number, name in enumerate(cls.arrays, 2)}

    def __init__(self, columns: Columns, first: int, last: int, steps: int, memory: Memory) -> None:
        self.plan, self.length, self._steps = self._plan(columns.layout), last - first, steps
        self.places: Int64 = np.empty(len(self.arrays) + 4, np.int64)
        size = unchecked(lay_out)(columns.block, self.plan, first, last, steps, self.places)
        self.memory = memory.bytes(size)

    @classmethod
    def _plan(cls, layout: ColumnLayout) -> PartPlan:
        """The arrays of a part that is made of some columns."""
        known = layout.derived.get(cls)
        if known is None:
            texts = layout.places(tuple(cls.texts.values()))
            arrays = []
            for kind, length, axes in cls.arrays.values():
                size = np.dtype(kind).itemsize * math.prod(axis for axis in axes if axis != STEPS)
                arrays.append((size, _LENGTHS.get(length) or layout.place(length), STEPS in axes))
            known = layout.derived[cls] = PartPlan(texts, layout.are_lists[texts], np.array(arrays, np.int64))
        return known

    def array(self, name: str, *shape: int) -> Array:
        """An array with a shape."""
        return np.ndarray(shape, self.arrays[name][0], self.memory, self.places.item(self._numbers[name]))

    def __getitem__(self, field: str) -> Any:
        """Value of a field."""
        if field in self.texts:
            return self._text(field)
        axes = [self._steps if axis == STEPS else axis for axis in self.arrays[field][2]]
        return self.array(field, self.length, *axes)

    def _text(self, field: str) -> Object | Ragged:
        """Texts or None of each row, or lists of texts."""
        begin, middle, end = self.places[:3].tolist()
        ends, counts = self.memory[begin:middle].view(np.int64), self.memory[middle:end].view(np.int32)
        first = 0
        for name, offsets in zip(self.texts, counts.reshape(len(self.texts), self.length + 1), strict=True):
            count = offsets.item(-1) if name in self.lists else self.length
            if name == field:
                break
            first += count + 1
        texts = Texts(ends[first : first + count + 1], self.memory[self.places.item(-2) :])
        if field in self.lists:
            return Ragged(offsets.copy(), texts.strings())
        return Texts(texts.ends, texts.data, offsets[1:] == offsets[:-1]).strings()
