"""Parts of a loaded scenario: their arrays are in one piece of memory, and become fields when they are read."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from enum import IntEnum
from functools import lru_cache
from typing import Any, ClassVar, NamedTuple

import numpy as np

from scenarionet_data.arrays.columns import ColumnLayout, Columns, Texts
from scenarionet_data.arrays.dtypes import Array, Int64
from scenarionet_data.arrays.memory import Memory
from scenarionet_data.arrays.ragged import Ragged
from scenarionet_data.codec.part_kernels import ENDS, ROWS, PartPlan, lay_out
from scenarionet_data.compiled.checking import unchecked
from scenarionet_data.errors import LakeError
from scenarionet_data.scenario.vocabulary import LightState, MapFeatureType, ObjectType, Provenance
from scenarionet_data.schema import tables

STEPS = -1
"""The axis over time, in ``StoredPart.arrays``."""
_LENGTHS = {"rows": ROWS, "ends": ENDS}


class ScenarioColumns(NamedTuple):
    """Rows of one table for some scenarios, concatenated.

    Attributes:
        columns: The rows.
        bounds: (scenarios + 1) first row of each scenario, and the end of the last one.
        memory: Memory of the arrays that are decoded from them.
    """

    columns: Columns
    bounds: list[int]
    memory: Memory


LAYOUTS = {
    table: ColumnLayout(column for column in tables.load(table).columns if column.name not in unused)
    for table, unused in {
        "tracks": {"scenario_id", "track_index"},
        "lights": {"scenario_id"},
        "maps": {"map_id", "feature_index", "tile"}
        | {f"{end}_{axis}" for end in ("min", "max", "origin") for axis in "xyz"},
    }.items()
}
"""Columns of each table that a scenario is decoded from."""


def codes(columns: Columns, name: str, vocabulary: type[IntEnum]) -> Array:
    """uint8 codes of a dictionary column, of lists concatenated.

    Raises:
        LakeError: A word is not in the vocabulary.
    """
    return codes_of_words(columns, name, vocabulary)[columns.values(name)]


def codes_of_words(columns: Columns, name: str, vocabulary: type[IntEnum]) -> Array:
    """uint8 code of each word of a dictionary column, and 0 for null behind them.

    Raises:
        LakeError: A word is not in the vocabulary.
    """
    return _table(name, columns.words[name], vocabulary)


@lru_cache(1024)
def _table(name: str, words: tuple[str, ...], vocabulary: type[IntEnum]) -> Array:
    known = _CODES[vocabulary]
    unknown = [word for word in words if word not in known]
    if unknown:
        raise LakeError(
            f"{name} is {unknown[0]!r}, which is no {vocabulary.__name__}: a file is damaged; "
            "`scenarionet maintain fsck --deep` names it; restore it from a copy of the lake, "
            "or convert its recordings again"
        )
    return np.array([*(known[word] for word in words), 0], np.uint8)


_CODES: dict[type[IntEnum], dict[str, int]] = {
    words: {member.name: member.value for member in words}
    for words in (ObjectType, MapFeatureType, LightState, Provenance)
}
"""Dict look-ups are ten times as fast as look-ups in the enum."""


class StoredPart:
    """Fields of a part with M rows, in memory of their own, which a kernel checks and fills.

    Args:
        rows: Rows of scenarios.
        scenario: The one among them.
        steps: T.

    Attributes:
        table: Table of the rows.
        columns: Columns that the kernel reads, in its order.
        words: Vocabulary of those that hold words.
        fill: The kernel, see ``fill_tracks``.
        expected: What is wrong if a column does not match the others.
        arrays: dtype and axes of each array by name, in order: those of 4 bytes come first, so that all are aligned.
            The first axis is ``rows``; ``ends``, which is one more; or the elements of a column of lists. Before the
            arrays are the ends of texts and the numbers of texts, behind them the texts, see ``copy_texts``.
        texts: Columns of texts by name of the field that they become.
        lists: Those of these fields that are lists of texts.
        dictionaries: Words of the columns that have a dictionary.
        length: M.
        memory: uint8.
        places: (arrays + 4,) int64 start of each array in it, and end of the last one.

    Raises:
        LakeError: Rows are inconsistent, or a word is unknown: the file is damaged.
    """

    table: ClassVar[str]
    columns: ClassVar[tuple[str, ...]]
    words: ClassVar[Mapping[str, type[IntEnum]]]
    fill: ClassVar[Callable[..., int]]
    expected: ClassVar[str]
    arrays: ClassVar[Mapping[str, tuple[type[np.generic], str, tuple[int, ...]]]]
    texts: ClassVar[Mapping[str, str]]
    lists: ClassVar[Sequence[str]] = ()
    _numbers: ClassVar[Mapping[str, int]]

    def __init_subclass__(cls) -> None:
        cls._numbers = {name: number for number, name in enumerate(cls.arrays, 2)}

    def __init__(self, rows: ScenarioColumns, scenario: int, steps: int) -> None:
        columns, first, last = rows.columns, rows.bounds[scenario], rows.bounds[scenario + 1]
        plan = columns.layout.derived.get(type(self)) or self._plan(columns.layout)
        self.dictionaries, self.length, self._steps = columns.words, last - first, steps
        self.places: Int64 = np.empty(len(self.arrays) + 4, np.int64)
        self.memory = rows.memory.bytes(unchecked(lay_out)(columns.block, plan, first, last, steps, self.places))
        codes = tuple([codes_of_words(columns, name, words) for name, words in self.words.items()])
        done = unchecked(type(self).fill)(columns.block, plan, first, last, steps, codes, self.memory, self.places)
        if done < len(self.columns):
            raise self.damage(self.columns[done])

    @classmethod
    def damage(cls, column: str) -> LakeError:
        """The error for a column that does not match the others."""
        return LakeError(
            f"{cls.table}.{column} {cls.expected}: its file is damaged; `scenarionet maintain check` lists the "
            "affected scenarios; restore the file from a copy of the lake, or convert its recordings again"
        )

    @classmethod
    def _plan(cls, layout: ColumnLayout) -> PartPlan:
        """The arrays of a part that is made of some columns."""
        texts = layout.places(tuple(cls.texts.values()))
        arrays = []
        for kind, length, axes in cls.arrays.values():
            size = np.dtype(kind).itemsize * math.prod(axis for axis in axes if axis != STEPS)
            arrays.append((size, _LENGTHS.get(length) or layout.place(length), STEPS in axes))
        described = np.array(arrays, np.int64)
        plan = PartPlan(layout.places(cls.columns), texts, layout.are_lists[texts], described)
        layout.derived[cls] = plan
        return plan

    def array(self, name: str, *shape: int) -> Array:
        """An array with a shape."""
        return np.ndarray(shape, self.arrays[name][0], self.memory, self.places.item(self._numbers[name]))

    def __getitem__(self, field: str) -> Any:
        """Value of a field."""
        if field in self.texts:
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
        axes = [self._steps if axis == STEPS else axis for axis in self.arrays[field][2]]
        return self.array(field, self.length, *axes)
