"""Threads over worlds, or other items."""

from __future__ import annotations

import os
import statistics
import time
from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor, wait
from functools import partial
from typing import TypeVar

from scenarionet_data.arrays.dtypes import Int64, is_count
from scenarionet_data.errors import BadParameter
from scenarionet_sim.threads.sharing import JOIN, LEADER, LEAVE, STAY, STAY_OUT, Team, ranges_of

Returned = TypeVar("Returned")

_FEWEST = 4
"""Items per thread below which another thread costs more than it saves."""

_TRIAL = 16
"""Number of turns that try to be alone, and then to have helpers; only the last half of either counts, because helpers
have to wake up and data to reach the cache of another core."""

_UNTIL_TRIAL = (256, 1024)
"""Turns from one trial to the next, alone and with helpers: another program may soon leave its core."""

_LAST_TRIAL = 0.5
"""Weight of the last trial in what is known of both."""


class Threads:
    """Runs a function in several threads; the calling thread is one of them.

    Args:
        count: Largest number of threads.

    Attributes:
        count: As above.
    """

    def __init__(self, count: int) -> None:
        if not is_count(count, 1):
            raise BadParameter(f"threads={count!r}; expected at least 1")
        self.count = count
        self._pool: ThreadPoolExecutor | None = None
        self._process = 0
        self._shared = -1  # number of items that were shared out last
        self._team = Team.of(0, 1)
        self._helpers: dict[int, Future[object]] = {}
        self._turn = 0  # since the last trial began
        self._trial: tuple[list[float], list[float]] = [], []  # times of turns [s], alone and with helpers
        self._pace = [0.0, 0.0]  # mean of the trials' medians [s]
        self._lent: object = None  # function whose arrays helpers may still use, by pointers without a reference

    def spread(self, function: Callable[[int, Int64], object], total: int) -> None:
        """Call ``function(own, ranges)`` in every thread, which takes from ``total`` items, see ``threads.sharing``.

        Unlike in :meth:`share`, threads keep nothing.
        """
        self._notice_fork()
        ranges = ranges_of(total, self._useful(total))
        others = [self._submit(partial(function, own, ranges)) for own in range(1, len(ranges))]
        function(0, ranges)
        for other in others:
            other.result()

    def share(self, function: Callable[[int, Team], object], total: int) -> int:
        """Share ``total`` items out to threads.

        Args:
            function: Calls a kernel with the number of the thread and the team, see ``threads.sharing``.
            total: Number of items.

        Returns:
            The largest result of any thread; -1 for none.
        """
        if self.count > 1:
            self._notice_fork()
            self._wait()  # for helpers in a turn that an interrupt or an error has ended
        if total != self._shared:
            self.dismiss()
            self._shared, self._team = total, Team.of(total, self._useful(total))
        if len(self._team.ranges) > 1:
            self._share_at_best_pace(function)
        else:
            function(LEADER, self._team)
        return self._team.result

    def _share_at_best_pace(self, function: Callable[[int, Team], object]) -> None:
        """Run a turn with helpers or alone, whichever is faster: helpers without a core of their own delay it."""
        place, is_faster = self._turn, self._pace[True] < self._pace[False]
        is_trial = place < 2 * _TRIAL
        is_helped = place >= _TRIAL if is_trial else is_faster
        self._turn = (place + 1) % _UNTIL_TRIAL[is_faster]
        self._team.order(JOIN if is_helped else STAY_OUT)
        if is_helped:
            for own in range(LEADER + 1, len(self._team.ranges)):
                self._call_helper(function, own)
        started, self._lent = time.perf_counter(), function
        function(LEADER, self._team)
        self._wait()
        if is_trial and place % _TRIAL >= _TRIAL // 2:
            self._trial[is_helped].append(time.perf_counter() - started)
        if place == 2 * _TRIAL - 1:
            for way, times in enumerate(self._trial):
                weight = _LAST_TRIAL if self._pace[way] else 1.0
                self._pace[way] += weight * (statistics.median(times) - self._pace[way])
                times.clear()

    def dismiss(self) -> None:
        """Let helpers drop what they were called with last; the next turn calls them again."""
        self._notice_fork()
        self._team.order(LEAVE)
        wait(self._helpers.values())
        self._team.order(JOIN)
        self._helpers = {}

    def close(self) -> None:
        """Stop the threads; the next run starts them again."""
        self.dismiss()
        if self._pool is not None:
            self._pool.shutdown()
        self._pool = None

    def _useful(self, total: int) -> int:
        return max(min(self.count, total // _FEWEST), 1)

    def _call_helper(self, function: Callable[[int, Team], object], own: int) -> None:
        """Let a helper wait for turns, unless it does."""
        helper = self._helpers.get(own)
        if helper is not None and not helper.done():
            return
        if helper is not None:
            self._helpers.pop(own).result()  # raises what the function raised
        self._helpers[own] = self._submit(partial(_help, function, own, self._team))

    def _wait(self) -> None:
        """Wait until helpers have ended the last turn, which takes them as long as an item at most."""
        while self._team.is_helped:
            os.sched_yield() if hasattr(os, "sched_yield") else time.sleep(0)  # give the core to a thread that waits
        self._lent = None

    def _submit(self, call: Callable[[], Returned]) -> Future[Returned]:
        """Call a function in a thread of the pool."""
        if self._pool is None:
            self._pool = ThreadPoolExecutor(self.count - 1, thread_name_prefix="worlds")
        return self._pool.submit(call)

    def _notice_fork(self) -> None:
        """Forget the threads in a forked process: they exist in its parent alone."""
        if self._process != os.getpid():
            self._process, self._pool, self._helpers, self._shared = os.getpid(), None, {}, -1


def _help(function: Callable[[int, Team], object], own: int, team: Team) -> None:
    """Join turns; also one that begins while this thread waits for the interpreter after the one before.

    After some turns it ends, as kernels do, to drop the arrays of the first one.
    """
    first = team.turn
    function(own, team)
    while team.awaits_helpers and team.turn - first < STAY:
        function(own, team)


def all_cores() -> int:
    """Return the number of cores that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
