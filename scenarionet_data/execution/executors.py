"""Who does the jobs: this process or a pool of processes here; a cluster elsewhere follows the same protocol.

What a job leaves behind depends on the job alone, so nothing but the time it takes depends on who does it.
"""

from __future__ import annotations

from collections.abc import Callable, Generator, Iterable, Iterator
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from dataclasses import dataclass
from functools import partial
from itertools import islice
from multiprocessing import get_context
from typing import Protocol, TypeVar

from scenarionet_data.errors import WorkerLost
from scenarionet_data.execution.worker import follow_parent

Work = TypeVar("Work")
Done = TypeVar("Done")

_KILLED = "a worker process was killed, most often for memory"
_IN_VAIN = 3
"""Pools that end, one after the other, before anything is done: the jobs are not to blame then."""

Lost = Callable[[Work, str], Done]
"""What becomes of a job that its worker did not survive: the job, and what happened."""


class Run(Protocol):
    """Who does jobs."""

    def __call__(
        self, jobs: Iterable[Work], do: Callable[[Work], Done], lost: Lost[Work, Done] | None = None
    ) -> Iterator[Done]:
        """Do every job; what each returned, in the order they are finished.

        Args:
            jobs: What there is to do; picklable. Read as it is needed.
            do: Does one: a function of a module. What it raises ends the run.
            lost: Stands in for a job that no worker survives, where that is known; unless given, it ends the run.

        Raises:
            WorkerLost: Workers are killed whatever they do, or by a job that nothing stands in for.
        """
        ...


def run_here(jobs: Iterable[Work], do: Callable[[Work], Done], lost: Lost[Work, Done] | None = None) -> Iterator[Done]:
    """One job after the other, in this process. A :class:`Run`."""
    return (_settled(job, partial(do, job), lost) for job in jobs)


def _settled(job: Work, result: Callable[[], Done], lost: Lost[Work, Done] | None) -> Done:
    """A job's result, or what stands in for it when it needs more memory than there is."""
    try:
        return result()
    except MemoryError:
        return _stand_in(job, "it needs more memory than there is; give it more, or fewer --workers", lost)


def _stand_in(job: Work, reason: str, lost: Lost[Work, Done] | None) -> Done:
    """What becomes of a job that cannot be done."""
    if lost is None:
        raise WorkerLost(reason)
    return lost(job, reason)


def runner(workers: int) -> Run:
    """This process for one worker, else a pool of processes."""
    return run_here if workers <= 1 else Pool(workers)


@dataclass(frozen=True)
class Pool:
    """Processes of this machine, with two jobs each in flight. A :class:`Run`.

    Attributes:
        workers: How many processes.
    """

    workers: int

    def __call__(
        self, jobs: Iterable[Work], do: Callable[[Work], Done], lost: Lost[Work, Done] | None = None
    ) -> Iterator[Done]:
        """Do every job; see :class:`Run`.

        When a worker is killed nobody can tell for which job: those in flight are done again at the end, each alone.
        """
        queue, suspects, in_vain = iter(jobs), list[Work](), 0
        while True:
            num_suspects = len(suspects)
            num_done = yield from self._until_killed(queue, do, lost, suspects)
            if len(suspects) == num_suspects:
                break
            in_vain = 0 if num_done else in_vain + 1
            if in_vain == _IN_VAIN:
                raise WorkerLost(
                    f"{_KILLED}; run the same command again, with fewer --workers: what is finished is kept"
                )
        for job in suspects:
            killers: list[Work] = []
            yield from Pool(1)._until_killed(iter([job]), do, lost, killers)
            if killers:
                yield _stand_in(job, f"{_KILLED}, also when nothing else ran; give it more memory", lost)

    def _until_killed(
        self, queue: Iterator[Work], do: Callable[[Work], Done], lost: Lost[Work, Done] | None, suspects: list[Work]
    ) -> Generator[Done, None, int]:
        """Do jobs until there are no more or a worker is killed: who was in flight is a suspect then.

        Returns:
            How many were done.
        """
        running: dict[Future[Done], Work] = {}
        num_done = 0
        # spawn: a forked child would share the locks of Arrow's and DuckDB's threads.
        with ProcessPoolExecutor(self.workers, get_context("spawn"), follow_parent) as pool:
            try:
                while True:
                    for job in islice(queue, 2 * self.workers - len(running)):
                        running[_submitted(pool, do, job)] = job
                    if not running:
                        return num_done
                    for future in wait(running, return_when=FIRST_COMPLETED).done:
                        result = _settled(running[future], future.result, lost)
                        del running[future]
                        num_done += 1
                        yield result
            except BrokenProcessPool:
                suspects += running.values()
                return num_done
            finally:
                for future in running:
                    future.cancel()


def _submitted(pool: ProcessPoolExecutor, do: Callable[[Work], Done], job: Work) -> Future[Done]:
    """The job's future; of a pool that has lost a worker meanwhile, one that says so."""
    try:
        return pool.submit(do, job)
    except BrokenProcessPool as error:
        future: Future[Done] = Future()
        future.set_exception(error)
        return future
