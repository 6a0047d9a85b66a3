"""Threads over ranges of worlds, frames or other items."""

from __future__ import annotations

import os
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor, wait

_FEWEST = 4
"""Items per thread below which another thread costs more than it saves."""

_PARTS = 2
"""Ranges of items by thread: items differ in cost, and threads begin at different times."""


class Threads:
    """Runs a function in several threads; the calling thread is one of them, and waits for none that comes too late.

    Args:
        count: Largest number of threads.

    Attributes:
        count: As above.
    """

    def __init__(self, count: int) -> None:
        self.count = count
        self._pool: ThreadPoolExecutor | None = None
        self._process = 0

    def run(self, function: Callable[[int, int, int], int], total: int) -> int:
        """Call ``function(own, first, end)`` for consecutive ranges of ``total`` items.

        Args:
            function: Called by thread ``own``, 0 for the calling one; releases the interpreter lock while it works.
            total: Number of items.

        Returns:
            The largest result; -1 for none.
        """
        count = max(min(self.count, total // _FEWEST), 1)
        size = total if count == 1 else -(-total // (count * _PARTS))
        firsts = iter(range(0, total, size or 1))  # whose next element only one thread gets

        def work(own: int) -> int:
            return max((function(own, first, min(first + size, total)) for first in firsts), default=-1)

        others = [self._threads().submit(work, own) for own in range(1, count)]
        try:
            largest = work(0)
        finally:
            begun = [other for other in others if not other.cancel()]
            wait(begun)  # also after an exception: they write to the same arrays
        return max([largest, *(other.result() for other in begun)])

    def close(self) -> None:
        """Stop the threads; the next run starts them again."""
        if self._pool is not None and self._process == os.getpid():
            self._pool.shutdown()
        self._pool = None

    def _threads(self) -> ThreadPoolExecutor:
        """Return the other threads, of this process: those of its parent do not exist in a forked one."""
        if self._pool is None or self._process != os.getpid():
            self._pool, self._process = ThreadPoolExecutor(self.count - 1, "worlds"), os.getpid()
        return self._pool


def all_cores() -> int:
    """Return the number of cores that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
