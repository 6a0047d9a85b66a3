"""Requests to an object store in threads: many at once to a far one, few to a near one."""

from __future__ import annotations

import math
import threading
from collections import deque
from collections.abc import Callable, Iterable
from concurrent.futures import Future, ThreadPoolExecutor
from typing import Any, TypeVar

MOST = 32
_FEWEST = 2
_NEAR = 0.004
"""A store that answers sooner [s] is on this machine or beside it: a few requests keep it busy."""
_TAKEN = 0.0006
"""Receiving and decoding a row group [s]: answers need not come more often."""

Given = TypeVar("Given")
Made = TypeVar("Made")


class Requests:
    """Runs what mostly waits for an object store.

    As many requests are under way as answers come in the time that the store takes for one (Little's law). More would
    wait for each other there, and what is wanted first would come with all the others.

    Args:
        answer_time: Tells how long the store takes for one answer [s]; None when that is not known yet.
    """

    def __init__(self, answer_time: Callable[[], float | None]) -> None:
        self._answer_time = answer_time
        self._threads = ThreadPoolExecutor(MOST, "scenarionet-requests")
        self._lock = threading.Lock()
        self._waiting: deque[tuple[Future[Any], Callable[..., Any], tuple[Any, ...]]] = deque()
        self._num_running = 0

    @property
    def at_once(self) -> int:
        """Requests that are under way together."""
        seconds = self._answer_time()
        if seconds is None:
            return MOST
        return _FEWEST if seconds < _NEAR else min(MOST, math.ceil(seconds / _TAKEN))

    def start(self, do: Callable[..., Made], *given: Any) -> Future[Made]:
        """Do something in another thread, in the order in which it is asked for."""
        future: Future[Made] = Future()
        with self._lock:
            self._waiting.append((future, do, given))
            is_full = self._num_running >= self.at_once
            self._num_running += not is_full
        if not is_full:
            self._threads.submit(self._run)
        return future

    def side_by_side(self, do: Callable[[Given], Made], given: Iterable[Given]) -> list[Made]:
        """What ``do`` makes of each, many at once."""
        listed = list(given)
        return [do(listed[0])] if len(listed) == 1 else list(self._threads.map(do, listed))

    def _run(self) -> None:
        """Do what waits, one after the other, until nothing does."""
        while True:
            with self._lock:
                if not self._waiting:
                    self._num_running -= 1
                    return
                future, do, given = self._waiting.popleft()
            if not future.set_running_or_notify_cancel():
                continue
            try:
                future.set_result(do(*given))
            except BaseException as error:  # whoever waits gets it
                future.set_exception(error)
