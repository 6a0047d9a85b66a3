"""Columns of a table as NumPy arrays: flat values, and lists as values with offsets."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Protocol

import numpy as np
import pyarrow as pa

from scenarionet_data.arrays.dtypes import Array, Int32
from scenarionet_data.errors import LakeError

_SCALARS = {"bool": pa.bool_(), "int32": pa.int32(), "float32": pa.float32(), "float64": pa.float64()}


class ColumnType(Protocol):
    """Name and type of a column; ``schema.tables.Column`` is one."""

    @property
    def name(self) -> str:
        """Name of the column."""

    @property
    def element(self) -> str:
        """Scalar type of the values, or of the elements of lists: ``float32``, ``string``, ``dictionary``, ..."""

    @property
    def is_list(self) -> bool:
        """Whether each row holds a list."""

    @property
    def nullable(self) -> bool:
        """Whether rows may be null."""

    @property
    def path(self) -> str:
        """Path of the leaf column in a Parquet file."""


@dataclass(frozen=True, eq=False)
class Lists:
    """A column of lists.

    Attributes:
        lengths: (num_rows,) int32; 0 for null as well.
        offsets: (num_rows + 1,) int32 start of each list, and end of the last one.
        values: (sum of lengths,) elements of all lists, concatenated.
    """

    lengths: Array
    offsets: Array
    values: Array


@dataclass(frozen=True, eq=False)
class Columns:
    """Rows of a table.

    Attributes:
        num_rows: Number of rows.
        flat: Columns of scalars, (num_rows,): float32 with NaN for null, int32, bool, str or None; nullable columns of
            bool as int8 with -1 for null, of int32 as float64 with NaN for null; dictionary columns as int32 indices
            with -1 for null.
        lists: Columns of lists of such values.
        words: The dictionary of each dictionary column.
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

    def pick(self, spans: Sequence[tuple[int, int]]) -> Columns:
        """Rows of some spans (first row, number of rows), concatenated.

        Raises:
            LakeError: A span exceeds the number of rows.
        """
        if any(first + count > self.num_rows for first, count in spans):
            raise LakeError("a file has fewer rows than its metadata; `scenarionet fsck` names it and the remedy")
        flat = {name: _concatenated(values, spans) for name, values in self.flat.items()}
        lists = {}
        for name, column in self.lists.items():
            ends = column.offsets
            parts = [(int(ends[first]), int(ends[first + count] - ends[first])) for first, count in spans]
            lengths = _concatenated(column.lengths, spans)
            lists[name] = Lists(lengths, offsets_of(lengths), _concatenated(column.values, parts))
        return Columns(sum(count for _, count in spans), flat, lists, self.words)

    @classmethod
    def from_arrow(cls, rows: pa.RecordBatch | pa.Table, columns: Iterable[ColumnType]) -> Columns:
        """Some columns of an Arrow table; columns that it lacks are null in every row."""
        flat: dict[str, Array] = {}
        lists: dict[str, Lists] = {}
        words: dict[str, Sequence[str]] = {}
        present = set(rows.schema.names)
        for declared in columns:
            name, element = declared.name, declared.element
            if name not in present:
                scalar = _SCALARS.get(element, pa.string())
                column = pa.nulls(rows.num_rows, pa.list_(scalar) if declared.is_list else scalar)
            else:
                column = rows.column(name)
                column = column.combine_chunks() if isinstance(column, pa.ChunkedArray) else column
            values = column.flatten() if declared.is_list else column
            if element == "dictionary":
                values = values if pa.types.is_dictionary(values.type) else values.dictionary_encode()
                words[name], values = values.dictionary.to_pylist(), values.indices.fill_null(-1)
            elif declared.nullable and not declared.is_list and element == "bool":
                values = values.cast(pa.int8()).fill_null(-1)
            elif declared.nullable and not declared.is_list and element == "int32":
                values = values.cast(pa.float64())
            found: Array = values.to_numpy(zero_copy_only=False)
            if declared.is_list:
                lengths = column.value_lengths().fill_null(0).to_numpy()
                lists[name] = Lists(lengths, offsets_of(lengths), found)
            else:
                flat[name] = found
        return cls(rows.num_rows, flat, lists, words)


def offsets_of(lengths: Array) -> Int32:
    """(n + 1,) int32 cumulative sum of lengths, starting at 0."""
    offsets = np.zeros(len(lengths) + 1, np.int32)
    np.cumsum(lengths, out=offsets[1:])
    return offsets


def _concatenated(values: Array, spans: Sequence[tuple[int, int]]) -> Array:
    if len(spans) == 1:
        ((first, count),) = spans
        return values[first : first + count]
    return np.concatenate([values[first : first + count] for first, count in spans])
