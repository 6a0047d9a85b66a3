"""What each worker did, whoever the workers are: every result brings along who made it, and how."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from typing import Any, Generic

from scenarionet_data.execution.executors import Done, Lost, Run, Work
from scenarionet_data.execution.worker import peak_memory, worker_name


@dataclass
class Share:
    """One worker's share of a run.

    Attributes:
        jobs: How many it did.
        seconds: Time it worked on them.
        peak_memory: The most memory it ever had [bytes].
        counts: Sums over its results, for example of scenarios.
    """

    jobs: int = 0
    seconds: float = 0.0
    peak_memory: int = 0
    counts: dict[str, int] = field(default_factory=dict)


@dataclass(frozen=True)
class _Result(Generic[Done]):
    """A result and how it came about; of no worker when none survived it."""

    value: Done
    worker: str | None = None
    seconds: float = 0.0
    peak_memory: int = 0


@dataclass(frozen=True)
class _Measured(Generic[Work, Done]):
    """Does a job on a worker and measures that; picklable."""

    do: Callable[[Work], Done]

    @property
    def __name__(self) -> str:
        return self.do.__name__

    def __call__(self, job: Work) -> _Result[Done]:
        started = time.monotonic()
        value = self.do(job)
        return _Result(value, worker_name(), time.monotonic() - started, peak_memory())


class Tally:
    """Counts by worker.

    Args:
        counts: What to sum of a result, by name.

    Attributes:
        shares: By the worker's name.
    """

    def __init__(self, counts: Callable[[Any], Mapping[str, int]] = lambda _: {}) -> None:
        self.shares: dict[str, Share] = {}
        self._counts = counts

    def __call__(
        self, run: Run, jobs: Iterable[Work], do: Callable[[Work], Done], lost: Lost[Work, Done] | None = None
    ) -> Iterator[Done]:
        """Have ``run`` do the jobs, and note who did which; see :class:`Run`."""
        replacement = None if lost is None else lambda job, why: _Result(lost(job, why))
        for result in run(jobs, _Measured(do), replacement):
            self._add(result)
            yield result.value

    def _add(self, result: _Result[Any]) -> None:
        if result.worker is None:
            return
        share = self.shares.setdefault(result.worker, Share())
        share.jobs += 1
        share.seconds += result.seconds
        share.peak_memory = max(share.peak_memory, result.peak_memory)
        for name, number in self._counts(result.value).items():
            share.counts[name] = share.counts.get(name, 0) + number
