"""Memory of arrays that is used again: the system clears each new page, which takes longer than decoding into it."""

from __future__ import annotations

import ctypes
import math
import sys
from collections.abc import Sequence
from functools import cache
from typing import Any

import numpy as np
import numpy.typing as npt

from scenarionet_data.arrays.dtypes import Array, UInt8

_SMALL = 2**14
"""Arrays of fewer bytes are left to NumPy."""
_TRIED = 4
"""Blocks that are looked at, of the first ones and of the others, before another one is made."""


_TRIM: Any = getattr(ctypes.CDLL(None), "malloc_trim", None) if sys.platform == "linux" else None


def release_unused() -> None:
    """Give free memory of the C library's heap back to the system; only glibc keeps much of it. Takes some ms."""
    if _TRIM is not None:
        _TRIM(0)


class Memory:
    """Memory for arrays, which is used for others when no array, view or tensor refers to it any more.

    For one thread. Nothing has to be given back.

    Args:
        limit: Bytes that are kept at most; arrays beyond it are NumPy's own.

    Attributes:
        num_bytes: Bytes of all blocks, in use or not.
    """

    def __init__(self, limit: int = 2**27) -> None:
        self._limit = limit
        self.num_bytes = 0
        self._blocks: dict[int, _Blocks] = {}  # by size
        self._num_refused = 0  # requests before blocks are looked at again
        self._scratch = np.empty(0, np.uint8)

    def scratch(self, size: int) -> UInt8:
        """At least so many bytes of any values, which the next call returns again."""
        if len(self._scratch) < size:
            self._scratch = np.empty(size, np.uint8)
        return self._scratch

    def bytes(self, size: int) -> UInt8:
        """At least so many bytes of any values, for arrays."""
        block = self._block(size) if size >= _SMALL else None
        return np.empty(size, np.uint8) if block is None else block

    def empty(self, shape: int | Sequence[int], dtype: npt.DTypeLike) -> Array:
        """Array of any values."""
        found = self._used_again(shape, dtype)
        return np.empty(shape, dtype) if found is None else found

    def zeros(self, shape: int | Sequence[int], dtype: npt.DTypeLike) -> Array:
        """Array of zeros."""
        found = self._used_again(shape, dtype)
        if found is None:
            return np.zeros(shape, dtype)
        found.reshape(-1).view(np.uint8).fill(0)  # of bytes: twice as fast
        return found

    def _used_again(self, shape: Any, dtype: npt.DTypeLike) -> Array | None:
        """Array in a block; None for small ones, and beyond the limit."""
        size = np.dtype(dtype).itemsize * (shape if isinstance(shape, int) else math.prod(shape))
        if size < _SMALL:
            return None
        block = self._block(size)
        return None if block is None else np.ndarray(shape, dtype, block)

    def _block(self, wanted: int) -> UInt8 | None:
        """Block of the next power of two that nothing refers to; None beyond the limit, and if use cannot be told."""
        if not _tells_use():
            return None
        size = 1 << (wanted - 1).bit_length()
        blocks = self._blocks.get(size)
        if blocks is None:
            blocks = self._blocks[size] = _Blocks()
        found = blocks.unused()
        if found is None and (self.num_bytes + size <= self._limit or self._makes_room(size)):
            found = np.empty(size, np.uint8)
            blocks.append(found)
            self.num_bytes += size
        return found

    def _makes_room(self, wanted: int) -> bool:
        """Drop all blocks that nothing refers to; returns whether there is room for another one then."""
        if self._num_refused:  # all are in use, and looking at all for each array takes longer than making it
            self._num_refused -= 1
            return False
        for blocks in self._blocks.values():
            blocks[:] = [blocks[place] for place in range(len(blocks)) if _references(blocks, place) != _UNUSED]
        self.num_bytes = sum(size * len(blocks) for size, blocks in self._blocks.items())
        has_room = self.num_bytes + wanted <= self._limit
        if not has_room:
            self._num_refused = sum(map(len, self._blocks.values()))
        return has_room


class _Blocks(list[UInt8]):
    """Blocks of a size."""

    turn = 0

    def unused(self) -> UInt8 | None:
        """A block that nothing refers to: of the first, which are in the caches, or of the others in turn."""
        count = len(self)
        for place in range(min(count, _TRIED)):
            if _references(self, place) == _UNUSED:
                return self[place]
        for _ in range(min(count - _TRIED, _TRIED)):
            self.turn = self.turn + 1 if _TRIED <= self.turn < count - 1 else _TRIED
            if _references(self, self.turn) == _UNUSED:
                return self[self.turn]
        return None


def _references(blocks: list[UInt8], place: int) -> int:
    """Number of references to a block, those of this call included; views of views refer to the block itself."""
    return sys.getrefcount(blocks[place])


_UNUSED = _references([np.empty(0, np.uint8)], 0)
"""References to a block that no array uses, which differ between versions of Python."""


@cache
def _tells_use() -> bool:
    """Return whether blocks in use are told from others: a test at first use, as other Pythons may count otherwise."""
    return all(_is_use_told() for _ in range(_HOT))


_HOT = 64
"""Repetitions after which Python has replaced its instructions by faster ones, which may count otherwise."""


def _is_use_told() -> bool:
    blocks = _Blocks([np.zeros(_SMALL, np.uint8)])
    found = blocks.unused()
    if found is None:
        return False
    view = np.ndarray(_SMALL // 4, np.int32, found)[1:].reshape(1, -1)
    del found
    is_kept = blocks.unused() is None and not view.any()
    del view
    return is_kept and blocks.unused() is not None
