"""Build Arrow arrays from NumPy arrays: lists, dictionary-encoded names, nulls."""

from __future__ import annotations

from collections.abc import Mapping
from enum import IntEnum
from typing import Any

import numpy as np
import pyarrow as pa

from scenarionet_data.arrays.dtypes import Array
from scenarionet_data.scenario import vocabulary
from scenarionet_data.scenario.vocabulary import LightState, MapFeatureType, ObjectType, Provenance
from scenarionet_data.schema import tables


def batch(table: str, columns: Mapping[str, Any]) -> pa.RecordBatch:
    """Record batch with the schema of a table."""
    schema = tables.load(table).schema
    arrays = [
        pa.array(columns[name]) if isinstance(columns[name], np.ndarray) else columns[name] for name in schema.names
    ]
    return pa.RecordBatch.from_arrays(arrays, schema=schema)


def list_array(offsets: Array, values: Any, mask: Array | None = None) -> pa.Array:
    """List array over flat values; null where ``mask`` is True."""
    child = values if isinstance(values, pa.Array) else pa.array(np.ascontiguousarray(values))
    kind = pa.list_(pa.field("element", child.type, nullable=False))
    nulls = None if mask is None else pa.array(mask)
    return pa.ListArray.from_arrays(pa.array(offsets), child, type=kind, mask=nulls)


def names_of(codes: Array, words: type[IntEnum]) -> pa.Array:
    """Dictionary-encoded names of codes; the dictionary holds the whole vocabulary in the order of its codes."""
    names, rank = _DICTIONARIES[words]
    return pa.DictionaryArray.from_arrays(pa.array(rank[codes]), names)


def _dictionaries() -> dict[type[IntEnum], tuple[pa.Array, Array]]:
    found: dict[type[IntEnum], tuple[pa.Array, Array]] = {}
    vocabularies: tuple[type[IntEnum], ...] = (ObjectType, MapFeatureType, LightState, Provenance)
    for words in vocabularies:
        names = vocabulary.names(words)
        used = np.array([name is not None for name in names])
        rank = np.cumsum(used, dtype=np.int32) - 1
        found[words] = (pa.array(names[used], pa.string()), rank.astype(np.int32))
    return found


_DICTIONARIES = _dictionaries()


def string_array(values: Array) -> pa.Array:
    """Object array of str or None as a string array."""
    # From a list: with an object array, pyarrow tries to import pandas on each call.
    return pa.array(values.tolist(), pa.string())
