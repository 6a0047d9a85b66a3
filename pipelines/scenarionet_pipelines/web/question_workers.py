"""Worker processes that answer questions, one question each at a time; stopped when a question takes too long."""

from __future__ import annotations

import asyncio
import shutil
import tempfile
from collections.abc import Awaitable, Callable, Mapping
from dataclasses import dataclass
from multiprocessing import get_context
from typing import Any

from scenarionet_data import Lake
from scenarionet_data.errors import QueryError, needing
from scenarionet_pipelines.web.choices import all_columns
from scenarionet_pipelines.web.questions import Learnt, Question, answer_questions
from scenarionet_pipelines.web.rows import PageColumn

with needing("browsing needs a web server", "web"):
    from starlette.concurrency import run_in_threadpool

_MAX_WORKERS = 4
_POLL_INTERVAL = 0.2
"""Interval at which a running question checks whether its client has disconnected [s]."""


@dataclass(frozen=True)
class Limits:
    """Limits of one question.

    Attributes:
        seconds: Time [s].
        memory: Memory of DuckDB [bytes]; larger operations spill to disk.
    """

    seconds: float = 10.0
    memory: int = 10**9


class QuestionWorkers:
    """Answers questions about a lake in up to four processes.

    There is always one process more than questions that are being answered, so that the next one need not wait for a
    process to start.

    Args:
        lake: The lake; its snapshot is read.
        limits: Limits of each question.

    Attributes:
        columns: The lake's columns by name.
    """

    def __init__(self, lake: Lake, limits: Limits) -> None:
        self.columns: dict[str, PageColumn] = {column.name: column for column in all_columns(lake)}
        self._lake = Lake(lake.root, lake.snapshot.number, lake.user_columns, max_memory=limits.memory)
        self._limits = limits
        self._free = asyncio.Semaphore(_MAX_WORKERS)
        self._idle: list[_Worker] = []
        self._busy: set[_Worker] = set()
        self._is_closed = False

    async def ask(self, question: Question[Learnt], is_abandoned: Callable[[], Awaitable[bool]]) -> Learnt:
        """Return the answer to a question.

        Args:
            question: The question.
            is_abandoned: Whether the answer is no longer wanted; the question is then stopped.

        Raises:
            QueryError: The question is wrong, or it was stopped, or the server was.
        """
        async with self._free:
            self.start_spare()
            if not self._idle:
                raise QueryError("the server has been stopped; start it again")
            worker = self._idle.pop()
            self._busy.add(worker)
            self.start_spare()
            asked = asyncio.ensure_future(run_in_threadpool(worker.ask, question, self._limits))
            try:
                while not (await asyncio.wait([asked], timeout=_POLL_INTERVAL))[0]:
                    if await is_abandoned():
                        worker.stop()
                answer: Learnt = asked.result()
                return answer
            finally:
                self._busy.remove(worker)
                if asked.done() and worker.is_usable:
                    self._idle.append(worker)
                else:
                    worker.stop()
                    self.start_spare()

    def start_spare(self) -> None:
        """Start a process if none is idle."""
        if not self._is_closed and not self._idle and len(self._busy) < _MAX_WORKERS:
            self._idle.append(_Worker(self._lake, self.columns, self._limits.memory))

    def close(self) -> None:
        """Stop all processes."""
        self._is_closed = True
        for worker in (*self._idle, *self._busy):
            worker.stop()


class _Worker:
    """A process that answers questions, one after the other."""

    def __init__(self, lake: Lake, columns: Mapping[str, PageColumn], memory: int) -> None:
        self.is_usable = True
        self._is_open = False
        self._folder = tempfile.mkdtemp(prefix="scenarionet-browse-")
        context = get_context("spawn")  # a forked child would share the locks of DuckDB's threads
        self._connection, other_end = context.Pipe()
        self._process = context.Process(
            target=answer_questions, args=(other_end, lake, columns, memory, self._folder), daemon=True
        )
        self._process.start()
        other_end.close()

    def ask(self, question: Question[Any], limits: Limits) -> Any:
        """Return the answer, or stop the process at the time limit."""
        try:
            found = None if self._is_open else self._connection.recv()
            if found is None:
                self._is_open = True
                self._connection.send(question)
                if not self._connection.poll(limits.seconds):
                    raise TimeoutError
                found = self._connection.recv()
        except TimeoutError as error:
            self.stop()
            raise QueryError(
                f"the question took more than {limits.seconds:g} s and was stopped; make the condition simpler, or "
                "start the server with a longer --timeout"
            ) from error
        except (EOFError, ConnectionError) as error:
            self.stop()
            raise QueryError(
                f"the question was stopped; if it needs more than {limits.memory / 1e9:g} GB of memory, make the "
                "condition simpler, or start the server with a larger --memory"
            ) from error
        if isinstance(found, Exception):
            raise found
        return found

    def stop(self) -> None:
        """End the process, whatever it is doing, and remove its temporary files."""
        self.is_usable = False
        self._process.kill()
        self._process.join()
        shutil.rmtree(self._folder, ignore_errors=True)
