"""Columns of a table in a few arrays, which kernels fill and read; NumPy arrays of a column are views of these."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple, Protocol

import numpy as np
import numpy.typing as npt
import pyarrow as pa

from scenarionet_data.arrays.dtypes import Array, Int32, Int64, Object
from scenarionet_data.arrays.texts import Texts
from scenarionet_data.errors import LakeError

WORDS, BITS, INDICES, TEXTS = range(4)
"""How values are stored: as numbers of 4 bytes, truth values, numbers of words in a dictionary, or texts."""

_STORED = {
    "float32": WORDS,
    "int32": WORDS,
    "bool": BITS,
    "dictionary": INDICES,
    "string": TEXTS,
    "json": TEXTS,
}


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


class Lists(NamedTuple):
    """A column of lists.

    Attributes:
        lengths: (num_rows,) int32; 0 for null as well.
        offsets: (num_rows + 1,) int32 start of each list, and end of the last one.
        values: (sum of lengths,) elements of all lists, concatenated.
    """

    lengths: Int32
    offsets: Int32
    values: Array


class ColumnBlock(NamedTuple):
    """Values of C columns in R rows; kernels take it whole.

    Attributes:
        lists: (2, C, R + 1) int32 length of each row's list, or 1 for a value and 0 for null; and offsets of lists.
        firsts: (C,) int64 place of a column's first value in the array of its kind.
        counts: (C,) int64 number of its values; R for a column that does not hold lists.
        words: uint32 bits of numbers, NaN for null; of INDICES, -1 for null.
        bits: int8 truth values, -1 for null.
        ends: int64 for each column of texts, the start of its first text and the end of each one in ``text``.
        text: uint8 UTF-8.
    """

    lists: Array
    firsts: Array
    counts: Array
    words: Array
    bits: Array
    ends: Array
    text: Array


class ColumnLayout:
    """The columns of a block.

    Args:
        columns: Columns of float32, bool, dictionary, string, json, and of int32 that are not nullable.

    Attributes:
        columns: The same.
        kinds: How the values of each one are stored.
        dtypes: dtype of the values of each one, if they are no texts.
        are_lists: (C,) bool.
    """

    def __init__(self, columns: Iterable[ColumnType]) -> None:
        self.columns = tuple(columns)
        self.kinds = [_STORED[column.element] for column in self.columns]
        self.dtypes = [_dtype(column) for column in self.columns]
        self.are_lists = np.array([column.is_list for column in self.columns], np.bool_)
        self._places = {column.name: place for place, column in enumerate(self.columns)}
        self._known: dict[tuple[str, ...], Int64] = {}

    def place(self, name: str) -> int:
        """Number of a column."""
        return self._places[name]

    def places(self, names: tuple[str, ...]) -> Int64:
        """Numbers of columns, the same array for the same names."""
        if names not in self._known:
            self._known[names] = np.array([self._places[name] for name in names], np.int64)
        return self._known[names]


def _dtype(column: ColumnType) -> str:
    if column.element == "bool":
        return "int8" if column.nullable and not column.is_list else "bool"
    return "float32" if column.element == "float32" else "int32"


@dataclass(frozen=True, eq=False)
class Columns:
    """Rows of a table.

    Attributes:
        num_rows: Number of rows.
        layout: The columns.
        block: Their values.
        words: The dictionary of each dictionary column.
    """

    num_rows: int
    layout: ColumnLayout
    block: ColumnBlock
    words: Mapping[str, tuple[str, ...]]

    def values(self, name: str) -> Array:
        """Scalars of all rows, or elements of all lists.

        They are float32 with NaN for null, int32, bool, of nullable columns int8 with -1 for null; of dictionary
        columns int32 indices with -1 for null.
        """
        return self._values(self.layout.place(name))

    def lists(self, name: str) -> Lists:
        """Lists of such values."""
        place = self.layout.place(name)
        lists = self.block.lists
        return Lists(lists[0, place, :-1], lists[1, place], self._values(place))

    def texts(self, name: str) -> Texts:
        """(num_rows,) texts, or the elements of lists of texts."""
        place = self.layout.place(name)
        first = self.block.firsts[place]
        ends = self.block.ends[first : first + self.block.counts[place] + 1]
        column = self.layout.columns[place]
        if not column.nullable or column.is_list:
            return Texts(ends, self.block.text)
        return Texts(ends, self.block.text, self.block.lists[0, place, :-1] == 0)

    @cached_property
    def numbers(self) -> Array:
        """float32 words of the block, for kernels."""
        return self.block.words.view(np.float32)

    def strings(self, name: str) -> Object:
        """(num_rows,) str or None of a column of texts or of a dictionary."""
        if name not in self.words:
            return self.texts(name).strings()
        strings: Object = np.array([*self.words[name], None], dtype=object)[self.values(name)]
        return strings

    def _values(self, place: int) -> Array:
        first, end = self.block.firsts[place], self.block.firsts[place] + self.block.counts[place]
        stored = self.block.bits if self.layout.kinds[place] == BITS else self.block.words
        return stored[first:end].view(self.layout.dtypes[place])

    def pick(self, spans: Sequence[tuple[int, int]]) -> Columns:
        """Rows of some spans (first row, number of rows), concatenated.

        Raises:
            LakeError: A span exceeds the number of rows.
        """
        if any(first + count > self.num_rows for first, count in spans):
            raise LakeError("a file has fewer rows than its metadata; `scenarionet fsck` names it and the remedy")
        parts: list[tuple[Array, Array | Texts]] = []
        for place, column in enumerate(self.layout.columns):
            lengths, ends = self.block.lists[0, place, :-1], self.block.lists[1, place]
            elements = [(ends[first], ends[first + count]) for first, count in spans]
            chosen = elements if column.is_list else [(first, first + count) for first, count in spans]
            kept = _concatenated([lengths[first : first + count] for first, count in spans], np.int32)
            if self.layout.kinds[place] == TEXTS:
                texts = self.texts(column.name)
                parts.append((kept, Texts.joined([texts.part(first, end) for first, end in chosen])))
            else:
                values = self._values(place)
                parts.append((kept, _concatenated([values[first:end] for first, end in chosen], values.dtype)))
        return _packed(sum(count for _, count in spans), self.layout, parts, self.words)

    @classmethod
    def from_arrow(cls, rows: pa.RecordBatch | pa.Table, layout: ColumnLayout) -> Columns:
        """Some columns of an Arrow table; columns that it lacks are null in every row.

        Raises:
            ArrowInvalid: A text is not UTF-8.
        """
        present, words = set(rows.schema.names), {}
        parts: list[tuple[Array, Array | Texts]] = []
        for declared, kind, dtype in zip(layout.columns, layout.kinds, layout.dtypes, strict=True):
            if declared.name not in present:
                column = pa.nulls(rows.num_rows, pa.list_(pa.null()) if declared.is_list else pa.null())
            else:
                column = rows.column(declared.name)
                column = column.combine_chunks() if isinstance(column, pa.ChunkedArray) else column
            lengths = column.value_lengths().fill_null(0) if declared.is_list else column.is_valid().cast(pa.int32())
            values = column.flatten() if declared.is_list else column
            if kind == INDICES:
                values = values if pa.types.is_dictionary(values.type) else values.cast("string").dictionary_encode()
                words[declared.name], values = tuple(values.dictionary.to_pylist()), values.indices
            if kind == TEXTS:
                parts.append((lengths.to_numpy(), Texts.from_arrow(values)))
                continue
            if kind != WORDS and values.null_count:
                values = values.cast(dtype).fill_null(-1)
            found = values.cast("float32" if dtype == "float32" else values.type).to_numpy(zero_copy_only=False)
            parts.append((lengths.to_numpy(), found.astype(dtype, copy=False)))
        return _packed(rows.num_rows, layout, parts, words)


def offsets_of(lengths: Array) -> Int32:
    """(n + 1,) int32 cumulative sum of lengths, starting at 0."""
    offsets = np.zeros(len(lengths) + 1, np.int32)
    np.cumsum(lengths, out=offsets[1:])
    return offsets


def _packed(
    num_rows: int,
    layout: ColumnLayout,
    parts: Iterable[tuple[Array, Array | Texts]],
    words: Mapping[str, tuple[str, ...]],
) -> Columns:
    """Columns from the lengths and the values of each one."""
    size = len(layout.columns)
    lists, firsts, counts = (
        np.zeros((2, size, num_rows + 1), np.int32),
        np.zeros(size, np.int64),
        np.zeros(size, np.int64),
    )
    numbers, bits, ends, text = (_Joined(kind) for kind in (np.uint32, np.int8, np.int64, np.uint8))
    for place, (lengths, values) in enumerate(parts):
        lists[0, place, :-1], lists[1, place] = lengths, offsets_of(lengths)
        if isinstance(values, Texts):
            start, end = values.ends[0], values.ends[-1]
            firsts[place], counts[place] = ends.size, len(values.ends) - 1
            ends.add(values.ends - start + text.size)
            text.add(values.data[start:end])
        else:
            joined = bits if layout.kinds[place] == BITS else numbers
            firsts[place], counts[place] = joined.size, len(values)
            joined.add(values)
    block = ColumnBlock(lists, firsts, counts, numbers.whole(), bits.whole(), ends.whole(), text.whole())
    return Columns(num_rows, layout, block, words)


class _Joined:
    """Arrays, one after the other, of their bits."""

    def __init__(self, kind: npt.DTypeLike) -> None:
        self.size = 0
        self._parts: list[Array] = [np.zeros(0, kind)]

    def add(self, values: Array) -> None:
        self._parts.append(np.ascontiguousarray(values).view(self._parts[0].dtype))
        self.size += len(values)

    def whole(self) -> Array:
        return np.concatenate(self._parts)


def _concatenated(values: Sequence[Array], kind: npt.DTypeLike) -> Array:
    found: Array = np.concatenate([np.zeros(0, kind), *values])
    return found
