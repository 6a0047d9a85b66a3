"""Decoder input: the columns of one table for several scenarios, and codes of vocabulary columns."""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum

import numpy as np

from scenarionet_data.arrays.columns import Columns
from scenarionet_data.arrays.dtypes import Array
from scenarionet_data.errors import LakeError
from scenarionet_data.scenario.vocabulary import LightState, MapFeatureType, ObjectType, Provenance


@dataclass(frozen=True, eq=False)
class ScenarioColumns:
    """Rows of one table for some scenarios, concatenated.

    Attributes:
        columns: The rows.
        bounds: (scenarios + 1) first row of each scenario, and the end of the last one.
    """

    columns: Columns
    bounds: list[int]


def codes(columns: Columns, name: str, vocabulary: type[IntEnum]) -> Array:
    """uint8 codes of a dictionary column, of lists concatenated.

    Raises:
        LakeError: A word is not in the vocabulary.
    """
    indices = columns.flat[name] if name in columns.flat else columns.lists[name].values
    known = _CODES[vocabulary]
    unknown = [word for word in columns.words[name] if word not in known]
    if unknown:
        raise LakeError(
            f"{name} is {unknown[0]!r}, which is no {vocabulary.__name__}: a file is damaged; `scenarionet fsck "
            "--deep` names it; restore it from a copy of the lake, or convert its recordings again"
        )
    found: Array = np.array([known[word] for word in columns.words[name]], np.uint8)[indices]
    return found


_CODES: dict[type[IntEnum], dict[str, int]] = {
    words: {member.name: member.value for member in words}
    for words in (ObjectType, MapFeatureType, LightState, Provenance)
}
"""Dict look-ups are ten times as fast as look-ups in the enum."""
