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
from scenarionet_data.codec.text_kernels import measure_texts


class StoredPart:
    """Fields of a part with M rows, in memory of their own.

    Args:
        length: M.
        counts: Number of elements of each array.

    Attributes:
        arrays: dtype of each array by name, in order: the widest come first, so that all are aligned. ``text_ends``,
            ``text_offsets`` and ``text`` are those of ``copy_texts``.
        texts: Columns of texts by name of the field that they become.
        lists: Those of these fields that are lists of texts.
        memory: uint8, filled by a kernel.
        places: Start of each array in it, and end of the last one.
    """

    arrays: ClassVar[Mapping[str, type[np.generic]]]
    texts: ClassVar[Mapping[str, str]]
    lists: ClassVar[Sequence[str]] = ()
    _widths: ClassVar[tuple[int, ...]]
    _numbers: ClassVar[Mapping[str, int]]

    def __init_subclass__(cls) -> None:
        cls._widths = tuple(np.dtype(kind).itemsize for kind in cls.arrays.values())
        cls._numbers = {name: number for number, name in enumerate(cls.arrays)}

    def __init__(self, length: int, counts: Sequence[int]) -> None:
        self._length = length
        self.places = tuple(accumulate(map(mul, self._widths, counts), initial=0))
        self.memory = np.zeros(self.places[-1], np.uint8)

    @classmethod
    def measure(cls, columns: Columns, first: int, last: int) -> tuple[int, int, int]:
        """Number of elements of ``text_ends``, ``text_offsets`` and ``text`` for some rows."""
        layout = columns.layout
        places = layout.places(tuple(cls.texts.values()))
        count, size = unchecked(measure_texts)(columns.block, places, layout.are_lists, first, last)
        return count + len(cls.texts), len(cls.texts) * (last - first + 1), size

    def array(self, name: str) -> Array:
        """An array, of one axis."""
        number = self._numbers[name]
        return self.memory[self.places[number] : self.places[number + 1]].view(self.arrays[name])

    def __contains__(self, field: str) -> bool:
        return field in self._numbers or field in self.texts

    def __getitem__(self, field: str) -> Any:
        """Value of a field."""
        return self._text(field) if field in self.texts else self.array(field)

    def _text(self, field: str) -> Object | Ragged:
        """Texts or None of each row, or lists of texts."""
        ends, first = self.array("text_ends"), 0
        for name, offsets in zip(self.texts, self.array("text_offsets").reshape(len(self.texts), -1), strict=True):
            count = offsets.item(-1) if name in self.lists else self._length
            if name == field:
                break
            first += count + 1
        texts = Texts(ends[first : first + count + 1], self.array("text"))
        if field in self.lists:
            return Ragged(offsets.copy(), texts.strings())
        return Texts(texts.ends, texts.data, offsets[1:] == offsets[:-1]).strings()
