"""Threads over worlds, or other items."""

from __future__ import annotations

import os
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from functools import partial

from scenarionet_data.arrays.dtypes import Int64
from scenarionet_sim.kernels.sharing import ranges_of

_FEWEST = 4
"""Items per thread below which another thread costs more than it saves."""


class Threads:
    """Runs a function in several threads; the calling thread is one of them.

    Args:
        count: Largest number of threads.
    """

    def __init__(self, count: int) -> None:
        self._count = count
        self._pool: ThreadPoolExecutor | None = None
        self._process = 0
        self._shared = -1  # number of items that were shared out last, and their ranges then and now
        self._whole = self._ranges = ranges_of(0, 1)

    def run(self, function: Callable[[int, int], int], total: int) -> list[int]:
        """Call ``function(first, end)`` for consecutive ranges of ``total`` items; return the results in order."""
        count = self._useful(total)
        ends = [total * part // count for part in range(count + 1)]
        return self._together([partial(function, *ends[part : part + 2]) for part in range(count)])

    def share(self, function: Callable[[int, Int64], int], total: int) -> list[int]:
        """Call ``function(own, ranges)`` in every thread, which takes items from ranges; see ``kernels.sharing``."""
        if total != self._shared:
            self._shared, self._whole = total, ranges_of(total, self._useful(total))
            self._ranges = self._whole.copy()
        self._ranges[:] = self._whole
        return self._together([partial(function, own, self._ranges) for own in range(len(self._ranges))])

    def _useful(self, total: int) -> int:
        return max(min(self._count, total // _FEWEST), 1)

    def _together(self, calls: list[Callable[[], int]]) -> list[int]:
        """Call functions at the same time; return their results."""
        if len(calls) == 1:
            return [calls[0]()]
        if self._pool is None or self._process != os.getpid():  # threads do not survive a fork
            self._pool, self._process = ThreadPoolExecutor(self._count - 1, thread_name_prefix="worlds"), os.getpid()
        others = [self._pool.submit(call) for call in calls[1:]]
        return [calls[0](), *(other.result() for other in others)]

    def close(self) -> None:
        """Stop the threads; the next run starts them again."""
        if self._pool is not None and self._process == os.getpid():
            self._pool.shutdown()
        self._pool = None


def all_cores() -> int:
    """Return the number of cores that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
