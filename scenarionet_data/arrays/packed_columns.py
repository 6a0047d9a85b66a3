"""Columns made of other ones, or of Arrow tables."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence

import numpy as np
import numpy.typing as npt
import pyarrow as pa

from scenarionet_data.arrays.columns import (
    BITS,
    FIRST,
    INDICES,
    LENGTHS,
    NUM_COLUMN_FIELDS,
    OFFSETS,
    SIZE,
    TEXTS,
    WIDEST,
    WORDS,
    ColumnBlock,
    ColumnLayout,
    Columns,
)
from scenarionet_data.arrays.dtypes import Array, Int32
from scenarionet_data.arrays.texts import Texts


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
        chosen = elements if column.is_list else [(first, first + count) for first, count in spans]
        kept = _concatenated([lengths[first : first + count] for first, count in spans], np.int32)
        if layout.kinds[place] == TEXTS:
            texts = columns.texts(column.name)
            parts.append((kept, Texts.joined([texts.part(first, end) for first, end in chosen])))
        else:
            values = columns.values(column.name)
            parts.append((kept, _concatenated([values[first:end] for first, end in chosen], values.dtype)))
    return _packed(sum(count for _, count in spans), layout, parts, columns.words)


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
    described = np.zeros((len(layout.columns), NUM_COLUMN_FIELDS), np.int64)
    memory = _Joined()
    for place, (lengths, values) in enumerate(parts):
        column = described[place]
        column[LENGTHS], column[OFFSETS] = memory.add(lengths, np.int32), memory.add(offsets_of(lengths), np.int32)
        if isinstance(values, Texts):
            start, end = values.ends[0], values.ends[-1]
            ends = values.ends + (memory.add(values.data[start:end], np.uint8) - start)
            column[FIRST], column[SIZE] = memory.add(ends, np.int64), len(ends) - 1
        else:
            kind = np.int8 if layout.kinds[place] == BITS else values.dtype
            column[FIRST], column[SIZE] = memory.add(values, kind), len(values)
    return Columns(num_rows, layout, ColumnBlock(described, memory.whole()), words)


class _Joined:
    """Arrays, one after the other in memory."""

    def __init__(self) -> None:
        self._size = 0
        self._parts: list[Array] = [np.zeros(0, np.uint8)]

    def add(self, values: Array, kind: npt.DTypeLike) -> int:
        """Add an array; returns the place of its first element, counted in elements."""
        added = np.ascontiguousarray(values, kind)
        gap = -self._size % WIDEST
        place = self._size + gap
        self._parts += [np.zeros(gap, np.uint8), added.view(np.uint8)]
        self._size = place + added.nbytes
        return place // added.itemsize

    def whole(self) -> Array:
        """The memory; its size is a multiple of all widths, for kernels, which see it as an array of each."""
        return np.concatenate([*self._parts, np.zeros(-self._size % WIDEST, np.uint8)])


def _concatenated(values: Sequence[Array], kind: npt.DTypeLike) -> Array:
    found: Array = np.concatenate([np.zeros(0, kind), *values])
    return found
