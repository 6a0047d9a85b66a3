"""Ctrl-C and SIGTERM: both end the command at once, keep what is finished, and say so."""

from __future__ import annotations

import signal
from types import FrameType
from typing import Any, NoReturn

import click


class Interrupted(click.ClickException):
    """The command was interrupted; the message says what was kept."""

    exit_code = 130

    def show(self, file: Any = None) -> None:
        """Print the message as one line."""
        click.echo(f"interrupted: {self.message}", file=file, err=True)


def stop_cleanly() -> None:
    """Make SIGTERM an interrupt like Ctrl-C, and let neither wait for worker processes."""
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, _interrupt)


def _interrupt(number: int, frame: FrameType | None) -> NoReturn:  # noqa: ARG001
    from multiprocessing import active_children

    for child in active_children():  # what they are writing has no name yet: nobody will see the half of it
        child.terminate()
    raise KeyboardInterrupt
