"""Texts of scenarios, which become str when they are read."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType

import numpy as np

from scenarionet_data.arrays.columns import Columns, chosen
from scenarionet_data.arrays.compiled import unchecked
from scenarionet_data.arrays.dtypes import Int32, Object
from scenarionet_data.arrays.ragged import Ragged
from scenarionet_data.arrays.texts import Texts
from scenarionet_data.codec.text_kernels import TextArrays, measure_texts

Words = tuple[tuple[str, ...], Int32]
_NONE: Mapping[str, Words] = MappingProxyType({})


class RowTexts:
    """Texts in some rows, in memory of their own.

    Args:
        columns: All rows.
        names: Columns of texts, by name of the field that they become.
        first, last: The rows.
        words: Words and (M,) int32 indices of fields that are in a dictionary.

    Attributes:
        arrays: For a kernel, which fills them.
    """

    def __init__(
        self,
        columns: Columns,
        names: Mapping[str, str],
        first: int,
        last: int,
        words: Mapping[str, tuple[tuple[str, ...], Int32]] = MappingProxyType({}),
    ) -> None:
        self._names, self._words = names, words
        places, are_lists = columns.layout.places(tuple(names.values())), columns.layout.are_lists
        count, size = unchecked(measure_texts)(columns.block, places, are_lists, first, last)
        self.arrays = TextArrays(
            places,
            are_lists,
            np.empty(len(places), np.int64),
            np.empty((len(places), last - first + 1), np.int32),
            np.empty(count + len(places), np.int64),
            np.empty(size, np.uint8),
        )

    def __contains__(self, field: str) -> bool:
        return field in self._names or field in self._words

    def __getitem__(self, field: str) -> Object | Ragged:
        """Values of a field: str or None of each row, or lists of str."""
        if field in self._words:
            return chosen(*self._words[field])
        columns, are_lists, firsts, all_offsets, all_ends, text = self.arrays
        place = list(self._names).index(field)
        end = firsts[place + 1] if place + 1 < len(firsts) else len(all_ends)
        ends, offsets = all_ends[firsts[place] : end], all_offsets[place]
        if are_lists[columns[place]]:
            return Ragged(offsets.copy(), Texts(ends, text).strings())
        return Texts(ends, text, offsets[1:] == offsets[:-1]).strings()
