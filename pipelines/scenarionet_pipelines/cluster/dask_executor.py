"""Run jobs on a Dask cluster: an ``execution.executors.Executor`` with a bounded number of jobs in flight."""

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
from scenarionet_data.execution.executors import Done, OnLost, Work

_POLL_INTERVAL = 1.0
_TIMEOUT = 30.0
_AHEAD = 0.5
_MAX_IN_FLIGHT = 32
"""Short jobs: keep ``_AHEAD`` seconds of work per worker in flight, at most this many jobs, so that none idles."""


class DaskExecutor:
    """Runs jobs on the workers of a cluster. An :class:`~scenarionet_data.execution.executors.Executor`.

    Dask retries a job whose worker is lost, up to ``allowed-failures`` times. After that the job is a suspect, and so
    are the jobs that were queued on the same worker. Suspects run again at the end, one at a time: one that kills its
    worker even then is the cause.

    Args:
        client: Connected to the scheduler.
        in_flight: Jobs per worker submitted at a time.
        patience: How long to wait while the cluster has no worker [s].
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
        """Address of the scheduler."""
        return str(self._client.scheduler_info(n_workers=0)["address"])

    @property
    def dashboard(self) -> str | None:
        """URL of Dask's dashboard; None if the scheduler has none."""
        has_dashboard = self._client.run_on_scheduler(
            lambda dask_scheduler: bool(dask_scheduler.http_application.applications)  # the pages of it are one
        )
        return str(self._client.dashboard_link) if has_dashboard else None  # Dask has a link in any case

    @property
    def workers(self) -> int:
        """Number of workers; refreshed at most once a second."""
        if time.monotonic() - self._looked_at > _POLL_INTERVAL or not self._workers:
            self._poll()
        return self._workers

    def wait_for_worker(self) -> None:
        """Wait for the first worker.

        Raises:
            ClusterLost: None started within ``patience``, or the scheduler has stopped.
        """
        while not self.workers:
            time.sleep(0.1)

    def __call__(
        self, jobs: Iterable[Work], do: Callable[[Work], Done], on_lost: OnLost[Work, Done] | None = None
    ) -> Iterator[Done]:
        """Run every job; see :class:`~scenarionet_data.execution.executors.Executor`.

        Raises:
            ClusterLost: The scheduler has stopped, or the cluster has had no worker for ``patience``.
            WorkerLost: A job kills its worker and there is no ``on_lost``.
        """
        suspects = []
        for job, result in self._run(jobs, do, self._max_in_flight):
            if isinstance(result, _JobLost):
                suspects.append(job)
            else:
                yield result
        for job, result in self._run(suspects, do, lambda: 1):
            if not isinstance(result, _JobLost):
                yield result
            elif on_lost:
                yield on_lost(job, result.reason)
            else:
                raise WorkerLost(result.reason)

    def _max_in_flight(self) -> int:
        return max(1, self.workers * max(self._in_flight, min(_MAX_IN_FLIGHT, round(self._rate * _AHEAD))))

    def _run(
        self, jobs: Iterable[Work], do: Callable[[Work], Done], max_in_flight: Callable[[], int]
    ) -> Iterator[tuple[Work, Done | _JobLost]]:
        """Submit jobs with a bound on those in flight; yield each with its result, in order of completion."""
        queue = iter(jobs)
        in_flight: dict[Any, tuple[Work, Future[Any]]] = {}
        finished: SimpleQueue[Future[Any]] = SimpleQueue()
        while True:
            for job, future in self._submit([*islice(queue, max(0, max_in_flight() - len(in_flight)))], do):
                in_flight[future.key] = job, future
                future.add_done_callback(finished.put)
            if not in_flight:
                return
            futures = self._wait(finished)
            self._done += len(futures)
            for future, result in zip(futures, self._results(futures), strict=True):
                yield in_flight.pop(future.key)[0], result

    def _submit(self, jobs: list[Work], do: Callable[[Work], Done]) -> Iterator[tuple[Work, Future[Any]]]:
        if not jobs:
            return
        name = getattr(do, "__name__", type(do).__name__)
        keys = [f"{name}-{uuid4().hex}" for _ in jobs]
        payloads = [pickle.dumps(job) for job in jobs]  # bytes: Dask would search a collection for futures
        futures = self._client.map(_OneAtATime(do), payloads, key=keys, pure=False)
        yield from zip(jobs, futures, strict=True)

    def _wait(self, finished: SimpleQueue[Future[Any]]) -> list[Future[Any]]:
        """Wait for at least one finished job."""
        while True:
            try:
                futures = [finished.get(timeout=_POLL_INTERVAL)]
                break
            except Empty:
                self._poll()
        while not finished.empty():
            futures.append(finished.get())
        return futures

    def _results(self, futures: list[Future[Any]]) -> list[Any]:
        """Results of finished jobs, or why one was lost; raises what a job raised."""
        if all(future.status == "finished" for future in futures):
            with suppress(Exception):  # the next line finds out which job failed
                return list(self._client.gather(futures))
        return [self._result(future) for future in futures]

    def _result(self, future: Future[Any]) -> Any:
        while not future.cancelled():
            try:
                return future.result(timeout=_TIMEOUT)
            except KilledWorker as error:
                lost = f"{error.allowed_failures + 1} workers were lost while running it"
                return _JobLost(f"{lost}, usually out of memory; give workers more memory, or see their logs")
            except MemoryError:
                return _JobLost("it needs more memory than a worker may use; give workers more memory")
            except (OSError, TimeoutError):
                if future.status == "error":  # raised by the job itself
                    raise
                self._poll()  # the worker was lost together with the result: Dask runs the job again
        raise self._gone()

    def _poll(self) -> None:
        """Refresh the number of workers and the rate of jobs.

        Raises:
            ClusterLost: The scheduler does not answer, or has had no worker for ``patience``.
        """
        try:
            self._workers = len(self._client.nthreads(callback_timeout=_TIMEOUT))
        except (OSError, TimeoutError, RuntimeError, AttributeError) as error:  # Dask's errors for a closed connection
            raise self._gone() from error
        now = time.monotonic()
        self._rate = self._done / max(now - self._looked_at, _POLL_INTERVAL) / max(1, self._workers)
        self._looked_at, self._done = now, 0
        if self._workers:
            self._seen_at = now
        elif now - self._seen_at > self._patience:
            raise ClusterLost(
                f"{self.address}: no worker for {self._patience:.0f} s; finished work is kept: start workers "
                f"(`dask worker {self.address} --nthreads 1`) and run the same command again"
            )

    def _gone(self) -> ClusterLost:
        return ClusterLost(
            f"{self.address}: the scheduler is gone; finished work is kept: restart it and run the same command again"
        )


@dataclass(frozen=True)
class _JobLost:
    """A job that killed its worker."""

    reason: str


_LOCK = threading.Lock()


@dataclass(frozen=True)
class _OneAtATime(Generic[Work, Done]):
    """Runs a pickled job on a worker, one at a time: converters and checks expect a single thread per process."""

    do: Callable[[Work], Done]

    def __call__(self, payload: bytes) -> Done:
        with _LOCK:
            job: Work = pickle.loads(payload)  # noqa: S301  # sent by the client, as is the code
            return self.do(job)
