"""Texts as bytes, of which str are made when they are read: a map has a thousand ids, which few programs look at."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import pyarrow as pa

from scenarionet_data.arrays.dtypes import Bool, Int64, Object, UInt8


@dataclass(frozen=True, eq=False, slots=True)
class Texts:
    """n texts.

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
