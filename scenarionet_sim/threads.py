"""Threads over ranges of worlds."""

from __future__ import annotations

import os
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor

_FEWEST = 4
"""Worlds per thread below which another thread costs more than it saves."""


class Threads:
    """Runs a function over ranges of worlds, one per thread; the calling thread takes the first.

    Args:
        count: Largest number of threads.
    """

    def __init__(self, count: int) -> None:
        self._count = count
        self._pool: ThreadPoolExecutor | None = None
        self._process = 0

    def run(self, function: Callable[[int, int], int], total: int) -> list[int]:
        """Call ``function(first, end)`` for consecutive ranges of ``total`` worlds; return the results in order."""
        count = max(min(self._count, total // _FEWEST), 1)
        if count == 1:
            return [function(0, total)]
        if self._pool is None or self._process != os.getpid():  # threads do not survive a fork
            self._pool, self._process = ThreadPoolExecutor(self._count - 1, thread_name_prefix="worlds"), os.getpid()
        ends = [total * part // count for part in range(count + 1)]
        others = [self._pool.submit(function, *ends[part : part + 2]) for part in range(1, count)]
        return [function(0, ends[1]), *(other.result() for other in others)]

    def close(self) -> None:
        """Stop the threads; the next run starts them again."""
        if self._pool is not None and self._process == os.getpid():
            self._pool.shutdown()
        self._pool = None


def all_cores() -> int:
    """Return the number of cores that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
