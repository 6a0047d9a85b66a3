"""Handling of Ctrl-C and SIGTERM: both end the command immediately and keep finished work."""

from __future__ import annotations

import signal
from types import FrameType
from typing import Any, NoReturn

import click


class Interrupted(click.ClickException):
    """The command was interrupted; the message states the kept work."""

    exit_code = 130

    def show(self, file: Any = None) -> None:
        """Print the message as one line."""
        click.echo(f"interrupted: {self.message}", file=file, err=True)


def handle_signals() -> None:
    """Make SIGINT and SIGTERM raise KeyboardInterrupt after terminating worker processes."""
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, _interrupt)


def _interrupt(number: int, frame: FrameType | None) -> NoReturn:  # noqa: ARG001
    from multiprocessing import active_children

    for child in active_children():  # their unfinished files are not published yet, so no reader can see them
        child.terminate()
    raise KeyboardInterrupt
