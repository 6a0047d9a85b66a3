"""Columns of a table in a few arrays, which kernels fill and read; NumPy arrays of a column are views of these."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from functools import lru_cache
from typing import Any, NamedTuple, Protocol

import numpy as np

from scenarionet_data.arrays.dtypes import Array, Int32, Int64, Object, UInt8
from scenarionet_data.arrays.texts import Texts

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
    strings: Object = _objects(words)[indices]
    return strings


@lru_cache(256)
def _objects(words: tuple[str, ...]) -> Object:
    """Words, and None behind them."""
    return np.array([*words, None], dtype=object)
