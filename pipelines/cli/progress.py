"""Progress of long tasks on standard error: a bar on a terminal, a line now and then elsewhere, or nothing."""

from __future__ import annotations

import sys
import time
from types import TracebackType
from typing import TYPE_CHECKING, Self

import click

from pipelines.cli.output import count, duration

if TYPE_CHECKING:
    from rich.progress import Progress as Bar

_LINE_EVERY = 10.0


class Progress:
    """A long task's progress.

    Args:
        task: What is going on, for example ``"convert waymo"``.
        step: What is counted, for example ``"shard"``.
        is_quiet: Say nothing.
    """

    def __init__(self, task: str, step: str = "scenario", *, is_quiet: bool = False) -> None:
        self.done = self.total = self.scenarios = 0
        self._task = task
        self._step = step
        self._started = self._line_at = time.monotonic()
        self._is_quiet = is_quiet
        self._bar = None if is_quiet or not sys.stderr.isatty() else _bar(task)

    def __enter__(self) -> Self:
        if self._bar:
            self._bar.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if self._bar:
            self._bar.stop()

    def update(self, done: int, total: int, scenarios: int) -> None:
        """Note progress.

        Args:
            done: Steps done.
            total: Steps there are.
            scenarios: Scenarios finished.
        """
        self.done, self.total, self.scenarios = done, total, scenarios
        if self._bar:
            self._bar.update(self._bar.task_ids[0], completed=done, total=total, rate=self._rate)
        elif not self._is_quiet and time.monotonic() - self._line_at >= _LINE_EVERY:
            self._line_at = time.monotonic()
            click.echo(self._line, err=True)

    @property
    def _elapsed(self) -> float:
        return max(time.monotonic() - self._started, 1e-9)

    @property
    def _rate(self) -> str:
        return f"{self.scenarios / self._elapsed:,.1f} scenarios/s"

    @property
    def _line(self) -> str:
        left = self._elapsed / self.done * (self.total - self.done)
        steps = f"{self.done:,} of {count(self.total, self._step)}"
        return f"{self._task}: {steps}, {self._rate}, about {duration(left)} left"


def _bar(task: str) -> Bar:
    from rich.console import Console
    from rich.progress import BarColumn, MofNCompleteColumn, TextColumn, TimeElapsedColumn, TimeRemainingColumn
    from rich.progress import Progress as Bar

    bar = Bar(
        TextColumn("{task.description}"),
        BarColumn(),
        MofNCompleteColumn(),
        TextColumn("{task.fields[rate]}"),
        TimeElapsedColumn(),
        TextColumn("left"),
        TimeRemainingColumn(),
        console=Console(stderr=True),
        transient=True,
    )
    bar.add_task(task, total=None, rate="")
    return bar
