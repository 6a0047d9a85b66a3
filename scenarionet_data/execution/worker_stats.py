"""Statistics by worker: jobs, time and memory, measured on the worker and sent back with each result."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from typing import Generic

from scenarionet_data.execution.executors import Done, Executor, OnLost, Work
from scenarionet_data.execution.worker import peak_memory, worker_name


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
