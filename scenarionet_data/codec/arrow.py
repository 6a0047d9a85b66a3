"""Arrow arrays from NumPy arrays and back: lists, names, nulls. Nothing here knows a scenario."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from enum import IntEnum
from typing import Any, TypeAlias

import numpy as np
import numpy.typing as npt
import pyarrow as pa

from scenarionet_data import tables, vocabulary
from scenarionet_data.ragged import Ragged
from scenarionet_data.vocabulary import LightState, MapFeatureType, ObjectType, Provenance

Array = npt.NDArray[Any]


@dataclass(frozen=True, eq=False)
class LoadedRows:
    """Rows of a table as they come out of a file.

    Attributes:
        batch: Their columns, but for those in ``lists``.
        lists: Columns of float lists that were read without Arrow: (num_rows,) int32 lengths and flat float32 values.
    """

    batch: pa.RecordBatch
    lists: Mapping[str, tuple[Array, Array]]

    @property
    def num_rows(self) -> int:
        """Rows."""
        return int(self.batch.num_rows)

    def column(self, name: str) -> pa.Array:
        """A column of the batch."""
        return self.batch.column(name)

    def slice(self, first: int, num_rows: int) -> LoadedRows:
        """Some of the rows."""
        cut = {}
        for name, (lengths, values) in self.lists.items():
            start = int(lengths[:first].sum())
            kept = lengths[first : first + num_rows]
            cut[name] = kept, values[start : start + int(kept.sum())]
        return LoadedRows(self.batch.slice(first, num_rows), cut)


Rows: TypeAlias = pa.RecordBatch | LoadedRows


def batch(table: str, columns: Mapping[str, Any]) -> pa.RecordBatch:
    """Record batch of a table of the contract, columns in its order."""
    schema = tables.load(table).schema
    arrays = [
        pa.array(columns[name]) if isinstance(columns[name], np.ndarray) else columns[name] for name in schema.names
    ]
    return pa.RecordBatch.from_arrays(arrays, schema=schema)


def offsets_of(lengths: Array) -> Array:
    """(n + 1,) int32 running sum of lengths, from 0."""
    offsets = np.zeros(len(lengths) + 1, np.int32)
    np.cumsum(lengths, out=offsets[1:])
    return offsets


def list_array(offsets: Array, values: Any, mask: Array | None = None) -> pa.Array:
    """List array over flat values; null where ``mask`` is True."""
    child = values if isinstance(values, pa.Array) else pa.array(np.ascontiguousarray(values))
    kind = pa.list_(pa.field("element", child.type, nullable=False))
    nulls = None if mask is None else pa.array(mask)
    return pa.ListArray.from_arrays(pa.array(offsets), child, type=kind, mask=nulls)


def names_of(codes: Array, words: type[IntEnum]) -> pa.Array:
    """Codes as dictionary-encoded names; the dictionary holds every name, in the order of the codes."""
    names, rank = _DICTIONARIES[words]
    return pa.DictionaryArray.from_arrays(pa.array(rank[codes]), names)


def codes_of(array: pa.Array, words: type[IntEnum]) -> Array:
    """Dictionary-encoded names (of any dictionary) as codes."""
    if not pa.types.is_dictionary(array.type):
        array = array.dictionary_encode()
    codes_by_name = _CODES[words]
    table = np.array([codes_by_name[name] for name in array.dictionary.to_pylist()], dtype=np.uint8)
    if not len(array):
        return np.zeros(0, np.uint8)
    codes: Array = table[array.indices.to_numpy()]
    return codes


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
_CODES = {words: {member.name: member.value for member in words} for words in _DICTIONARIES}
"""A dict answers ten times as quickly as an enum does."""


def string_array(values: Array) -> pa.Array:
    """Object array of str or None as a string array."""
    # From a list: given an object array, pyarrow looks for pandas first, every time.
    return pa.array(values.tolist(), pa.string())


def dictionary_of(values: Array) -> pa.Array:
    """Object array of str or None as a dictionary array."""
    listed = values.tolist()
    numbers = {word: number for number, word in enumerate(word for word in dict.fromkeys(listed) if word is not None)}
    indices = pa.array([numbers.get(word) for word in listed], pa.int32())
    return pa.DictionaryArray.from_arrays(indices, pa.array(list(numbers), pa.string()))


def numbers(rows: Rows, name: str) -> Array:
    """A column as a NumPy array."""
    numbers: Array = rows.column(name).to_numpy(zero_copy_only=False)
    return numbers


def floats(rows: Rows, name: str) -> Array:
    """float32 with NaN for null."""
    return numbers(rows, name).astype(np.float32, copy=False)


def bools(rows: Rows, name: str) -> Array:
    """A column as a bool array."""
    return numbers(rows, name).astype(np.bool_, copy=False)


def strings(rows: Rows, name: str) -> Array:
    """Object array of str, None for null."""
    column = rows.column(name)
    if column.null_count == len(column):
        return np.full(len(column), None, dtype=object)
    if pa.types.is_dictionary(column.type):
        column = column.dictionary_decode()
    strings: Array = column.to_numpy(zero_copy_only=False)
    return strings


def lists(rows: Rows, name: str) -> tuple[Array, Array]:
    """Lengths and flat values of a list column; empty values where every row is null."""
    if isinstance(rows, LoadedRows) and name in rows.lists:
        return rows.lists[name]
    column = rows.column(name)
    if column.null_count:
        return np.zeros(len(column), np.int32), np.zeros(0, np.float32)
    offsets = column.offsets.to_numpy()
    values = column.values.to_numpy(zero_copy_only=False)[offsets[0] : offsets[-1]]
    return np.diff(offsets), values


def points(rows: Rows, first: str, *others: str) -> Ragged:
    """List columns of one shape side by side, as lists of float32 points; 0 for a null column."""
    lengths, values = lists(rows, first)
    points = np.zeros((len(values), 1 + len(others)), np.float32)
    points[:, 0] = values
    for axis, name in enumerate(others, start=1):
        column = lists(rows, name)[1]
        if len(column):
            points[:, axis] = column
    return Ragged(offsets_of(lengths), points)


def id_lists(rows: Rows, name: str) -> Ragged:
    """A list column of ids."""
    column = rows.column(name)
    offsets = column.offsets.to_numpy()
    values = column.values.slice(offsets[0], offsets[-1] - offsets[0])
    return Ragged(offsets - offsets[0], values.to_numpy(zero_copy_only=False))
