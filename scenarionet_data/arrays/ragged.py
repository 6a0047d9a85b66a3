"""Ragged arrays: lists of different lengths in two flat arrays, for polylines, polygons and ids."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import chain, pairwise
from typing import Any

import numpy as np

from scenarionet_data.arrays.dtypes import Array, Int32


@dataclass(frozen=True, eq=False)
class Ragged:
    """M lists of different lengths.

    Attributes:
        offsets: (M + 1,) int32; list ``i`` is ``values[offsets[i]:offsets[i + 1]]``.
        values: (P, ...) elements of all lists, concatenated: (P, 3) float32 points [m],
            (P, 2) float32 widths [m], or (P,) str ids as an object array.

    Example:
        >>> lines = Ragged.from_lists([[[0, 0, 0], [1, 0, 0]], []], width=3)
        >>> len(lines), lines[0].shape, lines[1].shape
        (2, (2, 3), (0, 3))
    """

    offsets: Int32
    values: Array

    def __len__(self) -> int:
        return len(self.offsets) - 1

    def __getitem__(self, index: int) -> Array:
        """List ``index`` as a view."""
        if not -len(self) <= index < len(self):
            raise IndexError(f"list {index} of {len(self)}")
        index %= len(self)
        return self.values[self.offsets[index] : self.offsets[index + 1]]

    def __iter__(self) -> Iterator[Array]:
        return (self.values[start:end] for start, end in pairwise(self.offsets.tolist()))

    @property
    def lengths(self) -> Int32:
        """(M,) int32 number of elements of each list."""
        return self.offsets[1:] - self.offsets[:-1]

    def take(self, rows: Array) -> Ragged:
        """Select lists by index."""
        lengths = self.lengths[rows]
        offsets = _offsets(lengths)
        if not offsets[-1]:  # common for lists of ids
            return Ragged(offsets, self.values[:0])
        elements = np.arange(offsets[-1]) + np.repeat(self.offsets[rows] - offsets[:-1], lengths)
        return Ragged(offsets, self.values[elements])

    def bounds(self) -> tuple[Array, Array]:
        """Lower and upper corner of each list of points, both (M, width); NaN for an empty list."""
        rows = np.flatnonzero(self.lengths)
        lower, upper = np.full((2, len(self), *self.values.shape[1:]), np.nan, self.values.dtype)
        if len(rows):
            lower[rows] = np.minimum.reduceat(self.values, self.offsets[rows])
            upper[rows] = np.maximum.reduceat(self.values, self.offsets[rows])
        return lower, upper

    def is_equal(self, other: Ragged) -> bool:
        """Whether both have the same lists, bit for bit."""
        return (
            np.array_equal(self.offsets, other.offsets)
            and self.values.dtype == other.values.dtype
            and np.array_equal(self.values, other.values)
        )

    @classmethod
    def from_lists(cls, lists: Sequence[Any], width: int) -> Ragged:
        """Lists of points, each (n, width), as float32."""
        arrays = [np.asarray(points, dtype=np.float32).reshape(-1, width) for points in lists]
        values = np.concatenate(arrays) if arrays else np.zeros((0, width), np.float32)
        return cls(_offsets([len(array) for array in arrays]), values)

    @classmethod
    def from_flat(cls, lengths: Sequence[int] | Array, values: Array) -> Ragged:
        """Lists of these lengths over the concatenated elements ``values``."""
        return cls(_offsets(lengths), values)

    @classmethod
    def joined(cls, parts: Sequence[Ragged]) -> Ragged:
        """The lists of one or more parts, one after the other."""
        return cls.from_flat(
            np.concatenate([part.lengths for part in parts]), np.concatenate([p.values for p in parts])
        )

    @classmethod
    def from_ids(cls, lists: Sequence[Sequence[str]]) -> Ragged:
        """Lists of ids, as an object array of str."""
        flat = list(map(str, chain.from_iterable(lists)))
        return cls(_offsets(list(map(len, lists))), np.array(flat, dtype=object))

    @classmethod
    def empty(cls, size: int, width: int | None = None) -> Ragged:
        """``size`` empty lists: of points when ``width`` is given, else of ids."""
        values = np.zeros((0, width), np.float32) if width else np.zeros(0, dtype=object)
        return cls(np.zeros(size + 1, np.int32), values)


def _offsets(lengths: Sequence[int] | Array) -> Int32:
    offsets = np.zeros(len(lengths) + 1, np.int32)
    np.cumsum(lengths, dtype=np.int32, out=offsets[1:])
    return offsets
