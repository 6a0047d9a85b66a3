"""Items shared out to threads while they run.

Each thread has a range of items and takes those first, so that what it reads and writes stays in the cache of its core.
Then it takes what is left of the ranges of others: items differ in cost, and threads begin at different times.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from llvmlite import ir
from numba import types
from numba.core import cgutils
from numba.extending import intrinsic

from scenarionet_data.arrays.compiled import device_function
from scenarionet_data.arrays.dtypes import Int64

_types: Any = types  # numba has no types of its own
_intrinsic: Any = intrinsic
_cgutils: Any = cgutils

_NEXT, _END = 0, 1
"""Columns of ranges: the next item and the end. A row fills a cache line, since processors exchange whole lines."""


def ranges_of(total: int, count: int) -> Int64:
    """Return ``count`` consecutive ranges (count, 8) of ``total`` items, for :func:`take`."""
    ends = np.arange(count + 1) * total // count
    ranges = np.zeros((count, 8), np.int64)
    ranges[:, _NEXT], ranges[:, _END] = ends[:-1], ends[1:]
    return ranges


@device_function
def take(ranges: Int64, own: int) -> int:
    """Return an item that no other thread takes, of the thread's own range as long as it has any; -1 if none is left.

    Args:
        ranges: (T, 8) see :func:`ranges_of`; changed by every call.
        own: Range of the thread.
    """
    for k in range(len(ranges)):
        row = (own + k) % len(ranges)
        if ranges[row, _NEXT] < ranges[row, _END]:
            item: int = _take_next(ranges, row)
            if item < ranges[row, _END]:
                return item
    return -1


@_intrinsic
def _take_next(_: Any, ranges: Any, row: Any) -> Any:
    """The next item of a range, which moves on by one at the same moment for all threads."""

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        kind, one = signature.args[0], ir.Constant(ir.IntType(64), 1)
        array = context.make_array(kind)(context, builder, arguments[0])
        place = [arguments[1], ir.Constant(ir.IntType(64), _NEXT)]
        pointer = _cgutils.get_item_pointer(context, builder, kind, array, place)
        return builder.atomic_rmw("add", pointer, one, "seq_cst")

    return _types.int64(ranges, row), generate
