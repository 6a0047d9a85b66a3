"""Rows of a table as NumPy arrays, column by column: what decoding works on, whoever has read them."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from enum import IntEnum

import numpy as np
import pyarrow as pa

from scenarionet_data.arrays.dtypes import Array
from scenarionet_data.codec.arrow import offsets_of
from scenarionet_data.errors import LakeError
from scenarionet_data.scenario.vocabulary import LightState, MapFeatureType, ObjectType, Provenance
from scenarionet_data.schema.tables import Column


@dataclass(frozen=True, eq=False)
class Lists:
    """A column of lists.

    Attributes:
        lengths: (num_rows,) int32; 0 for null, too.
        offsets: (num_rows + 1,) int32 where each list begins, and the last one ends.
        values: (sum of lengths,) their elements, one list after the other.
    """

    lengths: Array
    offsets: Array
    values: Array


@dataclass(frozen=True, eq=False)
class Columns:
    """Rows of a table.

    Attributes:
        num_rows: Rows.
        flat: Columns of one value a row, (num_rows,): float32 with NaN for null, int32, bool, str or None; where they
            may be null, int8 with -1 for truth values and float64 with NaN for integers; of words, int32 numbers
            with -1 for null.
        lists: Columns of lists, of such values.
        words: What the numbers in columns of words stand for.
    """

    num_rows: int
    flat: Mapping[str, Array]
    lists: Mapping[str, Lists]
    words: Mapping[str, Sequence[str]] = field(default_factory=dict)

    def strings(self, name: str) -> Array:
        """(num_rows,) str or None."""
        if name not in self.words:
            return self.flat[name]
        strings: Array = np.array([*self.words[name], None], dtype=object)[self.flat[name]]
        return strings

    def codes(self, name: str, vocabulary: type[IntEnum]) -> Array:
        """uint8 codes of a column of words, of lists one list after the other.

        Raises:
            LakeError: A word is none of the vocabulary.
        """
        numbers = self.flat[name] if name in self.flat else self.lists[name].values
        known = _CODES[vocabulary]
        strange = [word for word in self.words[name] if word not in known]
        if strange:
            raise LakeError(
                f"{name} is {strange[0]!r}, which is no {vocabulary.__name__}: a file is damaged; `scenarionet fsck "
                "--deep` names it; restore it from a copy of the lake, or convert its recordings again"
            )
        codes: Array = np.array([known[word] for word in self.words[name]], np.uint8)[numbers]
        return codes

    def pick(self, spans: Sequence[tuple[int, int]]) -> Columns:
        """The rows of some spans, first row and number, one span after the other.

        Raises:
            LakeError: There are not as many rows.
        """
        if any(first + count > self.num_rows for first, count in spans):
            raise LakeError("a file has fewer rows than its lake says; `scenarionet fsck` names it, and the remedy")
        flat = {name: _pieces(values, spans) for name, values in self.flat.items()}
        lists = {}
        for name, column in self.lists.items():
            ends = column.offsets
            parts = [(int(ends[first]), int(ends[first + count] - ends[first])) for first, count in spans]
            lengths = _pieces(column.lengths, spans)
            lists[name] = Lists(lengths, offsets_of(lengths), _pieces(column.values, parts))
        return Columns(sum(count for _, count in spans), flat, lists, self.words)

    @classmethod
    def from_arrow(cls, batch: pa.RecordBatch | pa.Table, columns: Iterable[Column]) -> Columns:
        """These columns of Arrow rows."""
        flat: dict[str, Array] = {}
        lists: dict[str, Lists] = {}
        words: dict[str, Sequence[str]] = {}
        for declared in columns:
            column, name = batch.column(declared.name), declared.name
            column = column.combine_chunks() if isinstance(column, pa.ChunkedArray) else column
            values = column.flatten() if declared.is_list else column
            if declared.element == "dictionary":
                values = values if pa.types.is_dictionary(values.type) else values.dictionary_encode()
                words[name], values = values.dictionary.to_pylist(), values.indices
            found = _numpy(values, declared)
            if declared.is_list:
                lengths = column.value_lengths().fill_null(0).to_numpy()
                lists[name] = Lists(lengths, offsets_of(lengths), found)
            else:
                flat[name] = found
        return cls(batch.num_rows, flat, lists, words)


@dataclass(frozen=True, eq=False)
class Rows:
    """Rows of one table, those of some scenarios (or row groups) one after the other.

    Attributes:
        columns: The rows.
        bounds: (scenarios + 1) row at which each scenario begins, and the last one ends.
    """

    columns: Columns
    bounds: list[int]


def _numpy(values: pa.Array, declared: Column) -> Array:
    """Values as :class:`Columns` has them."""
    if declared.element == "dictionary":
        values = values.fill_null(-1)
    elif declared.type == "bool" and declared.nullable:
        values = values.cast(pa.int8()).fill_null(-1)
    elif declared.type == "int32" and declared.nullable:
        values = values.cast(pa.float64())
    found: Array = values.to_numpy(zero_copy_only=False)
    return found


def _pieces(values: Array, spans: Sequence[tuple[int, int]]) -> Array:
    if len(spans) == 1:
        ((first, count),) = spans
        return values[first : first + count]
    return np.concatenate([values[first : first + count] for first, count in spans])


_CODES: dict[type[IntEnum], dict[str, int]] = {
    words: {member.name: member.value for member in words}
    for words in (ObjectType, MapFeatureType, LightState, Provenance)
}
"""A dict answers ten times as quickly as an enum does."""
