"""Columns of a table in a few arrays, which kernels fill and read; NumPy arrays of a column are views of these."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Any, NamedTuple, Protocol

import numpy as np
import pyarrow as pa

from scenarionet_data.arrays.dtypes import Array, Bool, Int32, Int64, Object, UInt8

WORDS, BITS, INDICES, TEXTS = range(4)
"""How values are stored: as numbers of 4 bytes, truth values, numbers of words in a dictionary, or texts."""

WIDEST = 8
"""Bytes of the widest elements of a block; its memory is a multiple of that."""

NULLABLE, LIST = 1, 2
"""Shapes of a column."""

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


NUM_COLUMN_FIELDS = 9
LENGTHS, OFFSETS, FIRST, SIZE, SHAPE, KIND, ROOM, FIRST_BYTE, LAST_BYTE = range(NUM_COLUMN_FIELDS)
"""Fields of a column of a block; the last five are for those who fill it."""


class ColumnBlock(NamedTuple):
    """Values of C columns in R rows, in one piece of memory; kernels take it whole.

    Places in memory are counted in elements of their width.

    Attributes:
        columns: (C, NUM_COLUMN_FIELDS) int64 for each column the place of the lengths of its lists, (R,) int32, which
            are 1 for a value and 0 for null; of their offsets, (R + 1,) int32; of its values; and their number, which
            is R if it does not hold lists. Then LIST and NULLABLE, how the values are stored, how many there is room
            for, and the first and last place of the bytes of texts and dictionaries.
        memory: uint8. Of numbers, values are 4 bytes, with NaN for null; of INDICES int32, with -1 for null; of truth
            values int8, with -1 for null; of texts int64, the start of the first one and the end of each in memory.
    """

    columns: Int64
    memory: UInt8


class ColumnLayout:
    """The columns of a block.

    Args:
        columns: Columns of float32, bool, dictionary, string, json, and of int32 that are not nullable.

    Attributes:
        columns: The same.
        kinds: How the values of each one are stored.
        dtypes: dtype of the values of each one, if they are no texts.
        are_lists: (C,) bool.
        derived: What users of the columns derive from them once, by a key of their own.
    """

    def __init__(self, columns: Iterable[ColumnType]) -> None:
        self.columns = tuple(columns)
        self.kinds = [_STORED[column.element] for column in self.columns]
        self.dtypes = [_dtype(column) for column in self.columns]
        self.are_lists = np.array([column.is_list for column in self.columns], np.bool_)
        self._places = {column.name: place for place, column in enumerate(self.columns)}
        self.derived: dict[object, Any] = {}
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


@dataclass(frozen=True, eq=False, slots=True)
class Texts:
    """n texts as bytes, of which str are made when they are read: a map has a thousand ids, which few programs look at.

    Attributes:
        ends: (n + 1,) int64; text ``i`` is ``data[ends[i]:ends[i + 1]]``.
        data: (m,) uint8 UTF-8.
        is_null: (n,) bool; None if no text is null.
    """

    ends: Int64
    data: UInt8
    is_null: Bool | None = None

    def strings(self) -> Object:
        """(n,) str or None."""
        buffers = [None, pa.py_buffer(self.ends), pa.py_buffer(self.data)]
        found: Object = pa.Array.from_buffers(pa.large_string(), len(self.ends) - 1, buffers).to_numpy(
            zero_copy_only=False
        )
        if self.is_null is not None:
            found[self.is_null] = None
        return found

    def part(self, first: int, last: int) -> Texts:
        """Texts ``first`` to ``last`` in the same memory."""
        is_null = None if self.is_null is None else self.is_null[first:last]
        return Texts(self.ends[first : last + 1], self.data, is_null)

    @classmethod
    def joined(cls, parts: Sequence[Texts]) -> Texts:
        """Texts of several, in memory of their own."""
        lengths = np.concatenate([np.zeros(1, np.int64), *(np.diff(part.ends) for part in parts)])
        data = np.concatenate([part.data[part.ends[0] : part.ends[-1]] for part in parts])
        nulls = [np.zeros(len(p.ends) - 1, np.bool_) if p.is_null is None else p.is_null for p in parts]
        has_nulls = any(part.is_null is not None for part in parts)
        return cls(np.cumsum(lengths), data, np.concatenate(nulls) if has_nulls else None)

    @classmethod
    def from_arrow(cls, values: pa.Array) -> Texts:
        """Texts of an Arrow array.

        Raises:
            ArrowInvalid: A text is not UTF-8.
        """
        large = values.cast(pa.large_string())
        large.validate(full=True)
        _, ends, data = large.buffers()
        found = np.frombuffer(ends or bytes(8), np.int64)[large.offset : large.offset + len(large) + 1]
        is_null = large.is_null().to_numpy(zero_copy_only=False) if large.null_count else None
        return cls(found, np.frombuffer(data or b"", np.uint8), is_null)


class Columns:
    """Rows of a table.

    Args:
        num_rows: Number of rows.
        layout: The columns.
        block: Their values.
        words: The dictionary of each dictionary column.
    """

    def __init__(
        self, num_rows: int, layout: ColumnLayout, block: ColumnBlock, words: Mapping[str, tuple[str, ...]]
    ) -> None:
        self.num_rows, self.layout, self.block, self.words = num_rows, layout, block, words

    def values(self, name: str) -> Array:
        """Scalars of all rows, or elements of all lists.

        They are float32 with NaN for null, int32, bool, of nullable columns int8 with -1 for null; of dictionary
        columns int32 indices with -1 for null.
        """
        return self._values(self.layout.place(name))

    def lists(self, name: str) -> Lists:
        """Lists of such values."""
        place = self.layout.place(name)
        return Lists(self.lengths(place), self.offsets(place), self._values(place))

    def lengths(self, place: int) -> Int32:
        """(num_rows,) length of each list of a column, or 1 for a value and 0 for null."""
        return self._array(self.block.columns.item(place, LENGTHS), self.num_rows, "int32")

    def offsets(self, place: int) -> Int32:
        """(num_rows + 1,) start of each list of a column, and end of the last one."""
        return self._array(self.block.columns.item(place, OFFSETS), self.num_rows + 1, "int32")

    def texts(self, name: str) -> Texts:
        """(num_rows,) texts, or the elements of lists of texts."""
        place = self.layout.place(name)
        first, count = self._span(place)
        ends, column = self._array(first, count + 1, "int64"), self.layout.columns[place]
        is_null = self.lengths(place) == 0 if column.nullable and not column.is_list else None
        return Texts(ends, self.block.memory, is_null)

    def strings(self, name: str) -> Object:
        """(num_rows,) str or None of a column of texts or of a dictionary."""
        return chosen(self.words[name], self.values(name)) if name in self.words else self.texts(name).strings()

    def _values(self, place: int) -> Array:
        return self._array(*self._span(place), self.layout.dtypes[place])

    def _span(self, place: int) -> tuple[int, int]:
        """Place of a column's first value, and number of its values."""
        return self.block.columns.item(place, FIRST), self.block.columns.item(place, SIZE)

    def _array(self, first: int, count: int, dtype: str) -> Array:
        """Elements from a place in memory on."""
        return np.ndarray((count,), dtype, self.block.memory, first * np.dtype(dtype).itemsize)


def chosen(words: tuple[str, ...], indices: Int32) -> Object:
    """Words of a dictionary, or None for -1, as an array."""
    return _objects(words)[indices]


@lru_cache(256)
def _objects(words: tuple[str, ...]) -> Object:
    """Words, and None behind them."""
    return np.array([*words, None], dtype=object)


def from_arrow(rows: pa.RecordBatch | pa.Table, layout: ColumnLayout) -> Columns:
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


def pick(columns: Columns, spans: Sequence[tuple[int, int]]) -> Columns:
    """Rows of some spans (first row, number of rows), concatenated; the spans must be within the rows."""
    layout = columns.layout
    parts: list[tuple[Array, Array | Texts]] = []
    for place, column in enumerate(layout.columns):
        lengths, ends = columns.lengths(place), columns.offsets(place)
        elements = [(ends[first], ends[first + count]) for first, count in spans]
        ranges = elements if column.is_list else [(first, first + count) for first, count in spans]
        kept = np.concatenate([lengths[:0], *(lengths[first : first + count] for first, count in spans)])
        if layout.kinds[place] == TEXTS:
            texts = columns.texts(column.name)
            parts.append((kept, Texts.joined([texts.part(first, end) for first, end in ranges])))
        else:
            values = columns.values(column.name)
            parts.append((kept, np.concatenate([values[:0], *(values[first:end] for first, end in ranges)])))
    return _packed(sum(count for _, count in spans), layout, parts, columns.words)


def offsets_of(lengths: Array) -> Int32:
    """(n + 1,) int32 cumulative sum of lengths, starting at 0."""
    offsets = np.zeros(len(lengths) + 1, np.int32)
    np.cumsum(lengths, out=offsets[1:])
    return offsets


def _packed(
    num_rows: int,
    layout: ColumnLayout,
    parts: Sequence[tuple[Array, Array | Texts]],
    words: Mapping[str, tuple[str, ...]],
) -> Columns:
    """Columns from the lengths and the values of each one."""
    described = np.zeros((len(layout.columns), NUM_COLUMN_FIELDS), np.int64)
    pieces, size = [_PADDING[:0]], 0
    for column, (lengths, values), kind in zip(described, parts, layout.kinds, strict=True):
        added: list[Array] = [np.ascontiguousarray(lengths, np.int32), offsets_of(lengths)]
        if isinstance(values, Texts):
            added += values.data[values.ends[0] : values.ends[-1]], values.ends
        else:
            added.append(np.ascontiguousarray(values, np.int8 if kind == BITS else values.dtype))
        places = []
        for array in added:
            places.append(size)
            pieces += array.view(np.uint8), _PADDING[: -array.nbytes % WIDEST]
            size += len(pieces[-2]) + len(pieces[-1])
        if isinstance(values, Texts):
            pieces[-2] = (values.ends + (places[2] - values.ends[0])).view(np.uint8)
        column[LENGTHS], column[OFFSETS] = places[0] // 4, places[1] // 4
        column[FIRST], column[SIZE] = places[-1] // added[-1].itemsize, len(added[-1]) - isinstance(values, Texts)
    return Columns(num_rows, layout, ColumnBlock(described, np.concatenate(pieces)), words)


_PADDING: UInt8 = np.zeros(WIDEST, np.uint8)
"""Behind each array of a block, so that kernels, which see the memory as an array of each width, find all aligned."""
