"""Texts of scenarios, which become str when they are read."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from scenarionet_data.arrays.columns import Columns
from scenarionet_data.arrays.compiled import unchecked
from scenarionet_data.arrays.dtypes import Object
from scenarionet_data.arrays.ragged import Ragged
from scenarionet_data.arrays.texts import Texts
from scenarionet_data.codec.text_kernels import copy_texts, measure_texts


class RowTexts:
    """Texts in some rows, in memory of their own.

    Args:
        columns: All rows.
        names: Columns of texts, by name of the field that they become.
        first, last: The rows.
    """

    def __init__(self, columns: Columns, names: Mapping[str, str], first: int, last: int) -> None:
        layout, block = columns.layout, columns.block
        self._fields, self._layout = names, layout
        self._places = places = layout.places(tuple(names.values()))
        count, size = unchecked(measure_texts)(block, places, layout.are_lists, first, last)
        self._firsts = np.empty(len(places), np.int64)
        self._offsets = np.empty((len(places), last - first + 1), np.int32)
        self._ends, self._text = np.empty(count + len(places), np.int64), np.empty(size, np.uint8)
        unchecked(copy_texts)(
            block, places, layout.are_lists, first, self._firsts, self._offsets, self._ends, self._text
        )

    def __contains__(self, field: str) -> bool:
        return field in self._fields

    def __getitem__(self, field: str) -> Object | Ragged:
        """Values of a field: str or None of each row, or lists of str."""
        place = list(self._fields).index(field)
        end = self._firsts[place + 1] if place + 1 < len(self._firsts) else len(self._ends)
        ends, offsets = self._ends[self._firsts[place] : end], self._offsets[place]
        if self._layout.are_lists[self._places[place]]:
            return Ragged(offsets.copy(), Texts(ends, self._text).strings())
        return Texts(ends, self._text, offsets[1:] == offsets[:-1]).strings()
