"""Decoder input: the columns of one table for several scenarios, and codes of vocabulary columns."""

from __future__ import annotations

from enum import IntEnum
from functools import lru_cache
from typing import NamedTuple

import numpy as np

from scenarionet_data.arrays.columns import ColumnLayout, Columns
from scenarionet_data.arrays.dtypes import Array
from scenarionet_data.arrays.memory import Memory
from scenarionet_data.errors import LakeError
from scenarionet_data.scenario.vocabulary import LightState, MapFeatureType, ObjectType, Provenance
from scenarionet_data.schema import tables


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
    found: Array = codes_of_words(columns, name, vocabulary)[columns.values(name)]
    return found


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
