"""Long work over many scenarios, in parts that are done one by one, here or by several processes."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import TypeVar

from scenarionet_data.execution.executors import Executor, OnLost, executor_for
from scenarionet_data.execution.progress import Progress

Work = TypeVar("Work")
Done = TypeVar("Done", bound=Sequence[object])


@dataclass(frozen=True)
class Part:
    """Scenarios ``first`` to before ``end`` of the work."""

    number: int
    first: int
    end: int

    def __len__(self) -> int:
        return self.end - self.first


def parts_of(total: int, size: int) -> list[Part]:
    """``total`` scenarios in parts of at most ``size``.

    Example:
        >>> parts_of(5, 2)[-1]
        Part(number=2, first=4, end=5)
    """
    return [Part(number, first, min(first + size, total)) for number, first in enumerate(range(0, total, size))]


def do_parts(
    jobs: Sequence[Work],
    do: Callable[[Work], Done],
    workers: int,
    on_progress: Progress | None,
    executor: Executor | None = None,
    lost: OnLost[Work, Done] | None = None,
) -> Iterator[Done]:
    """What became of each job, in any order.

    Args:
        jobs: One for each part; picklable.
        do: Does one: a function of a module; what it returns has an entry for each scenario.
        workers: Processes.
        on_progress: Told about every finished part.
        executor: Does them in place of the processes, for example a cluster.
        lost: Stands in for a part that no worker survives.

    Raises:
        WorkerLost: A part kills its worker, also when it runs alone.
    """
    scenarios = 0
    executor = executor or executor_for(min(workers, len(jobs)))
    for number, outcome in enumerate(executor(jobs, do, lost), start=1):
        scenarios += len(outcome)
        if on_progress:
            on_progress(number, len(jobs), scenarios)
        yield outcome
