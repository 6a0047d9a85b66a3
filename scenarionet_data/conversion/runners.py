"""Who does the jobs: this process or a pool of processes here; a cluster elsewhere follows the same protocol.

What a job leaves behind depends on the job alone, so nothing but the time it takes depends on who does it.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from dataclasses import dataclass
from functools import partial
from multiprocessing import get_context
from typing import Protocol, TypeVar

from scenarionet_data.conversion.worker import follow_parent
from scenarionet_data.errors import WorkerLost

Work = TypeVar("Work")
Done = TypeVar("Done")

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
            WorkerLost: A worker was killed.
        """
        ...


def run_here(jobs: Iterable[Work], do: Callable[[Work], Done], lost: Lost[Work, Done] | None = None) -> Iterator[Done]:
    """One job after the other, in this process. A :class:`Run`."""
    return (_settled(job, partial(do, job), lost) for job in jobs)


def _settled(job: Work, result: Callable[[], Done], lost: Lost[Work, Done] | None) -> Done:
    """A job's result, or what stands in for it when it needs more memory than there is."""
    try:
        return result()
    except MemoryError as error:
        reason = "it needs more memory than there is; give it more, or fewer --workers"
        if lost is None:
            raise WorkerLost(reason) from error
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
        """Do every job; see :class:`Run`. A worker that is killed ends the run: nobody can tell for which job."""
        queue = iter(jobs)
        # spawn: a forked child would share the locks of Arrow's and DuckDB's threads.
        with ProcessPoolExecutor(self.workers, get_context("spawn"), follow_parent) as pool:
            running: dict[Future[Done], Work] = {}
            try:
                while True:
                    for job in queue:
                        running[pool.submit(do, job)] = job
                        if len(running) >= 2 * self.workers:
                            break
                    if not running:
                        return
                    for future in wait(running, return_when=FIRST_COMPLETED).done:
                        yield _settled(running.pop(future), future.result, lost)
            except BrokenProcessPool as error:
                raise WorkerLost(
                    "a worker process was killed, most often for memory; run the same command again, with fewer "
                    "--workers: what is finished is kept"
                ) from error
            finally:
                for future in running:
                    future.cancel()
