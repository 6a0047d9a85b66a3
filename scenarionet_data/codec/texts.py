"""Texts of scenarios, which become str when they are read."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from scenarionet_data.arrays.columns import Columns
from scenarionet_data.arrays.compiled import unchecked
from scenarionet_data.arrays.dtypes import Object
from scenarionet_data.arrays.ragged import Ragged
from scenarionet_data.arrays.texts import Texts
from scenarionet_data.codec.text_kernels import TextArrays, measure_texts


class RowTexts:
    """Texts in some rows, in memory of their own.

    Args:
        columns: All rows.
        names: Columns of texts, by name of the field that they become.
        first, last: The rows.

    Attributes:
        arrays: For a kernel, which fills them.
    """

    def __init__(self, columns: Columns, names: Mapping[str, str], first: int, last: int) -> None:
        self._names = names
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
        return field in self._names

    def __getitem__(self, field: str) -> Object | Ragged:
        """Values of a field: str or None of each row, or lists of str."""
        columns, are_lists, firsts, all_offsets, all_ends, text = self.arrays
        place = list(self._names).index(field)
        end = firsts[place + 1] if place + 1 < len(firsts) else len(all_ends)
        ends, offsets = all_ends[firsts[place] : end], all_offsets[place]
        if are_lists[columns[place]]:
            return Ragged(offsets.copy(), Texts(ends, text).strings())
        return Texts(ends, text, offsets[1:] == offsets[:-1]).strings()
