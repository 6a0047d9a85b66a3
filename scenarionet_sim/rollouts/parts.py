"""Work over many scenarios, divided into parts that run sequentially in this process or in several processes."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import TypeVar

from scenarionet_data.arrays.dtypes import is_count
from scenarionet_data.errors import BadParameter
from scenarionet_data.execution.executors import Executor, OnLost, executor_for
from scenarionet_data.execution.progress import Progress

PartJob = TypeVar("PartJob")
PartResult = TypeVar("PartResult", bound=Sequence[object])


@dataclass(frozen=True)
class Part:
    """Scenarios ``first`` to ``end`` (exclusive) of the work."""

    number: int
    first: int
    end: int

    def __len__(self) -> int:
        return self.end - self.first


def parts_of(total: int, size: int) -> list[Part]:
    """Divide ``total`` scenarios into parts of at most ``size``.

    Example:
        >>> parts_of(5, 2)[-1]
        Part(number=2, first=4, end=5)
    """
    return [Part(number, first, min(first + size, total)) for number, first in enumerate(range(0, total, size))]


def run_parts(
    jobs: Sequence[PartJob],
    run_job: Callable[[PartJob], PartResult],
    workers: int,
    on_progress: Progress | None,
    executor: Executor | None = None,
    on_lost: OnLost[PartJob, PartResult] | None = None,
) -> Iterator[PartResult]:
    """Yield the result of each job, in completion order.

    Args:
        jobs: One per part; picklable.
        run_job: Module-level function that runs one job; its result has one entry per scenario.
        workers: Number of processes.
        on_progress: Called after each finished part.
        executor: Runs the jobs instead of local processes, for example on a cluster.
        on_lost: Returns the result of a part whose worker was killed also when it ran alone.

    Raises:
        BadParameter: ``workers`` is no number.
        WorkerLost: A part kills its worker also when it runs alone, and ``on_lost`` is None.
    """
    if not is_count(workers, 1):
        raise BadParameter(f"workers={workers!r}; expected a whole number of 1 or more")
    scenarios = 0
    executor = executor or executor_for(workers, len(jobs))
    for number, result in enumerate(executor(jobs, run_job, on_lost), start=1):
        scenarios += len(result)
        if on_progress:
            on_progress(number, len(jobs), scenarios)
        yield result
