"""Progress of long tasks on standard error: a bar on a terminal, otherwise a line every ten seconds."""

from __future__ import annotations

import sys
import threading
import time
from types import TracebackType
from typing import TYPE_CHECKING, Self

import click

from scenarionet_data.compiled.announcing import telling
from scenarionet_pipelines.cli.output import count, duration

if TYPE_CHECKING:
    from rich.progress import Progress

_SECONDS_BETWEEN_LINES = 10.0


class ProgressDisplay:
    """Progress display of one task, as a context manager.

    Args:
        task: Description of the task, for example ``"convert waymo"``.
        step: Noun of one step, for example ``"shard"``.
        is_quiet: Display nothing.
    """

    def __init__(self, task: str, step: str = "scenario", *, is_quiet: bool = False) -> None:
        self.done = self.total = self.scenarios = 0
        self._task = task
        self._step = step
        self._is_quiet = is_quiet
        self._doing = "listing the work to do"
        self._started = time.monotonic()
        is_terminal = sys.stderr.isatty()
        self._bar = _bar(task) if is_terminal and not is_quiet else None
        self._telling = telling(self._tell)
        self._has_ended = threading.Event()
        self._lines = None if is_terminal or is_quiet else threading.Thread(target=self._print_lines, daemon=True)

    def __enter__(self) -> Self:
        self._telling.__enter__()
        if self._bar:
            self._bar.start()
        if self._lines:
            self._lines.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._telling.__exit__(kind, error, trace)
        self._has_ended.set()
        if self._bar:
            self._bar.stop()
        if self._lines:
            self._lines.join()

    def update(self, done: int, total: int, scenarios: int = 0) -> None:
        """Update the display.

        Args:
            done: Number of finished steps.
            total: Number of steps.
            scenarios: Number of finished scenarios.
        """
        self.done, self.total, self.scenarios = done, total, scenarios
        if self._bar:
            self._bar.update(self._bar.task_ids[0], completed=done, total=total, rate=self._rate)

    def _tell(self, message: str) -> None:
        """Print that compilation takes a while, above the bar or as a line."""
        self._doing = message[0].lower() + message[1:]
        if self._bar:
            self._bar.console.print(message, highlight=False)
        elif not self._is_quiet:
            click.echo(message, err=True)

    def _print_lines(self) -> None:
        """Print a line at regular intervals, even while no step finishes."""
        while not self._has_ended.wait(_SECONDS_BETWEEN_LINES):
            click.echo(self.line, err=True)

    @property
    def line(self) -> str:
        """The progress as one line of text."""
        elapsed = time.monotonic() - self._started
        steps = f"{self._task}: {self.done:,} of {count(self.total, self._step)} after {duration(elapsed)}"
        if not self.done:
            return steps if self.total else f"{self._task}: {self._doing}, for {duration(elapsed)}"
        left = elapsed / self.done * max(self.total - self.done, 0)  # trainings end with a whole round
        return ", ".join(filter(None, (steps, self._rate, f"about {duration(left)} left")))

    @property
    def _rate(self) -> str:
        elapsed = max(time.monotonic() - self._started, 1e-9)
        return f"{self.scenarios / elapsed:,.1f} scenarios/s" if self.scenarios else ""


def _bar(task: str) -> Progress:
    from rich import progress as rich
    from rich.console import Console

    bar = rich.Progress(
        rich.TextColumn("{task.description}"),
        rich.BarColumn(),
        rich.MofNCompleteColumn(),
        rich.TextColumn("{task.fields[rate]}"),
        rich.TimeElapsedColumn(),
        rich.TextColumn("left"),
        rich.TimeRemainingColumn(),
        console=Console(stderr=True),
        transient=True,
    )
    bar.add_task(task, total=None, rate="")
    return bar
