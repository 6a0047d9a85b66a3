"""A Dask cluster's workers as a ``conversion.runners.Run``: few jobs in flight, each with its fate."""

from __future__ import annotations

import pickle
import threading
import time
from collections.abc import Callable, Iterable, Iterator
from contextlib import suppress
from dataclasses import dataclass
from itertools import islice
from queue import Empty, SimpleQueue
from typing import Any, Generic
from uuid import uuid4

from distributed import Client, Future
from distributed.scheduler import KilledWorker

from scenarionet_data.errors import ClusterLost, WorkerLost
from scenarionet_data.execution.executors import Done, Lost, Work

_LOOK_EVERY = 1.0
_ANSWER_WITHIN = 30.0
_AHEAD = 0.5
_MAX_IN_FLIGHT = 32
"""Jobs of milliseconds: as many per worker as it does in so many seconds, lest it waits for the next."""


class Crew:
    """The workers of a cluster. A :class:`~scenarionet_data.execution.executors.Run`.

    A job whose worker is lost is done again by another one, as often as the scheduler's ``allowed-failures`` says.
    Then it is a suspect, like the jobs that waited on the same worker: suspects come last, one at a time, so that
    one that kills its worker again has nobody else to blame.

    Args:
        client: Connected to the scheduler.
        in_flight: Jobs per worker that the scheduler knows at a time.
        patience: Seconds without any worker that are borne.
    """

    def __init__(self, client: Client, in_flight: int = 2, patience: float = 300.0) -> None:
        self._client = client
        self._in_flight = in_flight
        self._patience = patience
        self._workers = self._done = 0
        self._rate = 0.0
        self._looked_at = self._seen_at = time.monotonic()

    @property
    def address(self) -> str:
        """Of the scheduler."""
        return str(self._client.scheduler_info(n_workers=0)["address"])

    @property
    def dashboard(self) -> str:
        """Link to Dask's dashboard."""
        return str(self._client.dashboard_link)

    @property
    def workers(self) -> int:
        """Workers that the scheduler knew when it was asked last, not long ago."""
        if time.monotonic() - self._looked_at > _LOOK_EVERY or not self._workers:
            self._look()
        return self._workers

    def wait_for_worker(self) -> None:
        """Wait until there is one.

        Raises:
            ClusterLost: None came within the crew's patience, or the scheduler is gone.
        """
        while not self.workers:
            time.sleep(0.1)

    def __call__(
        self, jobs: Iterable[Work], do: Callable[[Work], Done], lost: Lost[Work, Done] | None = None
    ) -> Iterator[Done]:
        """Do every job; see :class:`~scenarionet_data.execution.executors.Run`.

        Raises:
            ClusterLost: The scheduler is gone, or has had no worker for long.
            WorkerLost: No worker survives a job, and nothing stands in for it.
        """
        suspects = []
        for job, result in self._each(jobs, do, self._room):
            if isinstance(result, _Lost):
                suspects.append(job)
            else:
                yield result
        for job, result in self._each(suspects, do, lambda: 1):
            if not isinstance(result, _Lost):
                yield result
            elif lost:
                yield lost(job, result.reason)
            else:
                raise WorkerLost(result.reason)

    def _room(self) -> int:
        """How many jobs may be in flight."""
        return max(1, self.workers * max(self._in_flight, min(_MAX_IN_FLIGHT, round(self._rate * _AHEAD))))

    def _each(
        self, jobs: Iterable[Work], do: Callable[[Work], Done], room: Callable[[], int]
    ) -> Iterator[tuple[Work, Done | _Lost]]:
        """Hand jobs to the scheduler, as many at a time as there is room for; each with its result, as they come."""
        queue = iter(jobs)
        flying: dict[Any, tuple[Work, Future[Any]]] = {}
        landed: SimpleQueue[Future[Any]] = SimpleQueue()
        while True:
            for job, future in self._submit([*islice(queue, max(0, room() - len(flying)))], do):
                flying[future.key] = job, future
                future.add_done_callback(landed.put)
            if not flying:
                return
            futures = self._wait(landed)
            self._done += len(futures)
            for future, result in zip(futures, self._results(futures), strict=True):
                yield flying.pop(future.key)[0], result

    def _submit(self, jobs: list[Work], do: Callable[[Work], Done]) -> Iterator[tuple[Work, Future[Any]]]:
        if not jobs:
            return
        name = getattr(do, "__name__", type(do).__name__)
        keys = [f"{name}-{uuid4().hex}" for _ in jobs]
        payloads = [pickle.dumps(job) for job in jobs]  # to Dask a text, not a collection to search for futures
        futures = self._client.map(_OneAtATime(do), payloads, key=keys, pure=False)
        yield from zip(jobs, futures, strict=True)

    def _wait(self, landed: SimpleQueue[Future[Any]]) -> list[Future[Any]]:
        """Those that have landed, at least one."""
        while True:
            try:
                futures = [landed.get(timeout=_LOOK_EVERY)]
                break
            except Empty:
                self._look()
        while not landed.empty():
            futures.append(landed.get())
        return futures

    def _results(self, futures: list[Future[Any]]) -> list[Any]:
        """What each returned, or why there is nothing; raises what a job raised."""
        if all(future.status == "finished" for future in futures):
            with suppress(Exception):  # of which future, the next line finds out
                return list(self._client.gather(futures))
        return [self._result(future) for future in futures]

    def _result(self, future: Future[Any]) -> Any:
        while not future.cancelled():
            try:
                return future.result(timeout=_ANSWER_WITHIN)
            except KilledWorker as error:
                lost = f"{error.allowed_failures + 1} workers were lost while they did it"
                return _Lost(f"{lost}, most often for memory; give workers more memory, or look at their logs")
            except MemoryError:
                return _Lost("it needs more memory than a worker may have; give workers more")
            except (OSError, TimeoutError):
                if future.status == "error":  # the job's own
                    raise
                self._look()  # its worker is gone with the result: another one does it again
        raise self._gone()

    def _look(self) -> None:
        """Ask the scheduler how many workers there are.

        Raises:
            ClusterLost: It does not answer, or has had none for long.
        """
        try:
            self._workers = len(self._client.nthreads(callback_timeout=_ANSWER_WITHIN))
        except (OSError, TimeoutError, RuntimeError, AttributeError) as error:  # whatever Dask makes of a closed line
            raise self._gone() from error
        now = time.monotonic()
        self._rate = self._done / max(now - self._looked_at, _LOOK_EVERY) / max(1, self._workers)
        self._looked_at, self._done = now, 0
        if self._workers:
            self._seen_at = now
        elif now - self._seen_at > self._patience:
            raise ClusterLost(
                f"{self.address}: no worker for {self._patience:.0f} s; what is finished is kept: start workers "
                f"(`dask worker {self.address} --nthreads 1`) and run the same command again"
            )

    def _gone(self) -> ClusterLost:
        return ClusterLost(
            f"{self.address}: the scheduler is gone; what is finished is kept: start it again and run the same command"
        )


@dataclass(frozen=True)
class _Lost:
    """No worker survived the job."""

    reason: str


_TURN = threading.Lock()


@dataclass(frozen=True)
class _OneAtATime(Generic[Work, Done]):
    """Does a pickled job on a worker, one at a time: what converts and checks is one thread a process."""

    do: Callable[[Work], Done]

    def __call__(self, payload: bytes) -> Done:
        with _TURN:
            job: Work = pickle.loads(payload)  # noqa: S301  # the client's, like all that a worker is sent
            return self.do(job)
