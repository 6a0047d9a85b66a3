"""Executors: run jobs in this process or in a pool of processes; a cluster implements the same protocol.

The result of a job depends on the job alone, so the choice of executor changes nothing but the time a run takes.
"""

from __future__ import annotations

import os
import platform
import resource
import sys
import time
from collections.abc import Callable, Generator, Iterable, Iterator, Mapping
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from dataclasses import dataclass, field
from itertools import islice
from multiprocessing import get_context
from pathlib import Path
from typing import Generic, Protocol, SupportsIndex, TypeVar

from scenarionet_data.errors import BadParameter, WorkerLost
from scenarionet_data.execution.worker import follow_parent

Work = TypeVar("Work")
Done = TypeVar("Done")

_OUT_OF_MEMORY = "it needs more memory than is available; use a larger machine or fewer workers"
_KILLED = "a worker process was killed, usually because the machine ran out of memory"
_MAX_IDLE_RESTARTS = 3
"""Consecutive pools that break before finishing a job: then the cause is not one of the jobs."""

OnLost = Callable[[Work, str], Done]
"""Makes the result of a job that kills its worker, from the job and the reason."""


class Executor(Protocol):
    """Runs jobs."""

    def __call__(
        self, jobs: Iterable[Work], do: Callable[[Work], Done], on_lost: OnLost[Work, Done] | None = None
    ) -> Iterator[Done]:
        """Run every job and yield the results in order of completion.

        Args:
            jobs: Picklable; read lazily.
            do: Runs one job: a module-level function. An exception it raises ends the run.
            on_lost: Makes a result for a job that kills its worker; by default such a job ends the run.

        Raises:
            WorkerLost: Workers are killed regardless of the job, or a job kills its worker and there is no ``on_lost``.
        """
        ...


def run_serially(
    jobs: Iterable[Work], do: Callable[[Work], Done], on_lost: OnLost[Work, Done] | None = None
) -> Iterator[Done]:
    """Run jobs one after the other in this process. An :class:`Executor`."""
    for job in jobs:
        try:
            result = do(job)
        except MemoryError:
            result = _replacement(job, _OUT_OF_MEMORY, on_lost)
        yield result


def _replacement(job: Work, reason: str, on_lost: OnLost[Work, Done] | None) -> Done:
    """The result of a job that cannot be run."""
    if on_lost is None:
        raise WorkerLost(reason)
    return on_lost(job, reason)


def executor_for(workers: int, num_jobs: int | None = None) -> Executor:
    """:func:`run_serially` for one worker or job, else a :class:`ProcessExecutor` of no more workers than jobs.

    Raises:
        BadParameter: ``workers`` is no number of processes.
    """
    if not isinstance(workers, SupportsIndex) or workers < 1:
        raise BadParameter(f"workers: wanted 1 or more, found {workers!r}")
    needed = workers if num_jobs is None else min(workers, num_jobs)
    return run_serially if needed <= 1 else ProcessExecutor(needed)


@dataclass(frozen=True)
class ProcessExecutor:
    """Runs jobs in processes of this machine, with up to two jobs per process in flight. An :class:`Executor`.

    Attributes:
        workers: Number of processes.
    """

    workers: int

    def __call__(
        self, jobs: Iterable[Work], do: Callable[[Work], Done], on_lost: OnLost[Work, Done] | None = None
    ) -> Iterator[Done]:
        """Run every job; see :class:`Executor`.

        A killed worker breaks the whole pool without a hint at the job that caused it: all jobs in flight become
        suspects, and suspects run again at the end, each in its own pool.
        """
        queue, suspects, idle_restarts = iter(jobs), list[Work](), 0
        while True:
            num_suspects = len(suspects)
            num_done = yield from self._run_until_broken(queue, do, on_lost, suspects)
            if len(suspects) == num_suspects:
                break
            idle_restarts = 0 if num_done else idle_restarts + 1
            if idle_restarts == _MAX_IDLE_RESTARTS:
                raise WorkerLost(f"{_KILLED}; finished work is kept: run the same command again with fewer workers")
        for job in suspects:
            killers: list[Work] = []
            yield from ProcessExecutor(1)._run_until_broken(iter([job]), do, on_lost, killers)
            if killers:
                yield _replacement(job, f"{_KILLED}, even with no other job running; give it more memory", on_lost)

    def _run_until_broken(
        self,
        queue: Iterator[Work],
        do: Callable[[Work], Done],
        on_lost: OnLost[Work, Done] | None,
        suspects: list[Work],
    ) -> Generator[Done, None, int]:
        """Run jobs until the queue is empty or a worker is killed; then add the jobs in flight to ``suspects``.

        Returns:
            Number of finished jobs.
        """
        running: dict[Future[Done], Work] = {}
        num_done = 0
        # spawn: a forked child would share the locks of Arrow's and DuckDB's threads.
        with ProcessPoolExecutor(self.workers, get_context("spawn"), follow_parent) as pool:
            try:
                while True:
                    for job in islice(queue, 2 * self.workers - len(running)):
                        try:
                            future = pool.submit(do, job)
                        except BrokenProcessPool as error:  # collect the results that are ready before giving up
                            future = Future()
                            future.set_exception(error)
                        running[future] = job
                    if not running:
                        return num_done
                    for future in wait(running, return_when=FIRST_COMPLETED).done:
                        try:
                            result = future.result()
                        except MemoryError:
                            result = _replacement(running[future], _OUT_OF_MEMORY, on_lost)
                        del running[future]
                        num_done += 1
                        yield result
            except BrokenProcessPool:
                suspects += running.values()
                return num_done
            finally:
                for future in running:
                    future.cancel()


@dataclass
class WorkerStats:
    """Work done by one worker.

    Attributes:
        jobs: Number of finished jobs.
        seconds: Time spent on them.
        peak_memory: Peak resident memory of the process [bytes].
        counts: Sums over its results, for example of scenarios.
    """

    jobs: int = 0
    seconds: float = 0.0
    peak_memory: int = 0
    counts: dict[str, int] = field(default_factory=dict)

    def add(self, seconds: float, peak_memory: int, counts: Mapping[str, int] | None = None) -> None:
        """Add a finished job."""
        self.jobs += 1
        self.seconds += seconds
        self.peak_memory = max(self.peak_memory, peak_memory)
        for name, number in (counts or {}).items():
            self.counts[name] = self.counts.get(name, 0) + number


@dataclass(frozen=True)
class _Measurement(Generic[Done]):
    """A result with its worker and cost; no worker if the job killed it."""

    value: Done
    worker: str | None = None
    seconds: float = 0.0
    peak_memory: int = 0


@dataclass(frozen=True)
class _Measure(Generic[Work, Done]):
    """Runs a job on a worker and measures it; picklable."""

    do: Callable[[Work], Done]

    @property
    def __name__(self) -> str:
        return self.do.__name__

    def __call__(self, job: Work) -> _Measurement[Done]:
        started = time.monotonic()
        value = self.do(job)
        return _Measurement(value, worker_name(), time.monotonic() - started, peak_memory())


class MeasuringExecutor:
    """Runs jobs with another executor and collects statistics by worker. An :class:`Executor`.

    Args:
        executor: Runs the jobs.

    Attributes:
        stats: By the worker's name.
    """

    def __init__(self, executor: Executor) -> None:
        self.stats: dict[str, WorkerStats] = {}
        self._executor = executor

    def __call__(
        self, jobs: Iterable[Work], do: Callable[[Work], Done], on_lost: OnLost[Work, Done] | None = None
    ) -> Iterator[Done]:
        """Run every job; see :class:`Executor`."""
        replacement = None if on_lost is None else lambda job, reason: _Measurement(on_lost(job, reason))
        for result in self._executor(jobs, _Measure(do), replacement):
            if result.worker is not None:
                self.stats.setdefault(result.worker, WorkerStats()).add(result.seconds, result.peak_memory)
            yield result.value


def worker_name() -> str:
    """Name of this process in reports: host and process id."""
    return f"{platform.node()}-{os.getpid()}"


def peak_memory() -> int:
    """Peak resident memory of this process [bytes]."""
    try:  # ru_maxrss includes the parent's memory from before exec
        status = Path("/proc/self/status").read_text()
        return 1024 * int(status.split("VmHWM:")[1].split()[0])
    except (OSError, IndexError):
        return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * (1 if sys.platform == "darwin" else 1024)
