"""Ctrl-C and SIGTERM: both end the command in one line on standard error and keep finished work.

Python runs signal handlers between two bytecodes of the main thread, so a handler alone would wait for a DuckDB query
or a compilation. A thread that reads Python's wakeup pipe therefore ends the process if the handler does not run, or if
the call in which it ran does not return: DuckDB notices the signal, but waits for its threads.

Within DuckDB, and while modules are imported, the handler raises nothing, because an exception at the wrong moment
aborts the process there (DuckDB's binding has calls that must not fail). It cancels the query instead, and the thread
has KeyboardInterrupt raised if the main thread goes on after it.
"""

from __future__ import annotations

import os
import select
import signal
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from types import FrameType
from typing import TYPE_CHECKING, Any

import click

if TYPE_CHECKING:
    from scenarionet_data.query.engine import Engine

_PATIENCE = 1.0
"""How long compiled code may keep the handler from running, and repeated signals are taken for one [s]."""

_ENDINGS = {signal.SIGINT: "interrupted", signal.SIGTERM: "terminated"}

_ENGINE = "scenarionet_data.query.engine"
"""Imported by verbs that ask DuckDB something; the others are quicker without."""

_WAKING = signal.SIGURG
"""Sent to the main thread to wake it. Polars installs its own handler of SIGINT, after which waits are resumed."""


class _Received:
    """The signal that ends this process, if any."""

    number: signal.Signals | None = None
    place: tuple[FrameType | None, int] = None, 0
    """Where the main thread was: its frame, and the instruction in it."""
    is_handled = threading.Event()
    is_pending = False
    """Whether KeyboardInterrupt is still to be raised, after a query or an import."""
    woken = 0.0
    """When the main thread last ran one of the handlers [s]."""
    is_explained = False
    """Whether a KeyboardInterrupt would become a line and an exit code; otherwise a signal ends the process at once."""


class Interrupted(click.ClickException):
    """The command was interrupted; the message states the kept work."""

    @property
    def exit_code(self) -> int:  # type: ignore[override]  # depends on the signal
        """128 and the number of the signal."""
        return 128 + (received() or signal.SIGINT)

    def show(self, file: Any = None) -> None:
        """Print the message as one line."""
        click.echo(f"{_ENDINGS[received() or signal.SIGINT]}: {self.message}", file=file, err=True)


def received() -> signal.Signals | None:
    """Return the signal that ends this process; None while it runs undisturbed."""
    return _Received.number


@contextmanager
def interruptible() -> Iterator[None]:
    """Let signals raise KeyboardInterrupt in the block; before and after it there is nothing to keep."""
    _Received.is_explained = True
    try:
        yield
    finally:
        _Received.is_explained = False


@contextmanager
def keeping(kept: Callable[[], str]) -> Iterator[None]:
    """Tell what is kept if the block is interrupted, and how to continue.

    Args:
        kept: Returns the work that is kept.

    Raises:
        Interrupted: The block was interrupted.
    """
    try:
        yield
    except KeyboardInterrupt as error:
        raise Interrupted(f"{kept()}; run the same command again to continue") from error


def stop(message: str) -> None:
    """Print that a verb that runs until it is stopped has stopped; Ctrl-C is success.

    Raises:
        Interrupted: It was stopped by SIGTERM.
    """
    if received() == signal.SIGTERM:
        raise Interrupted(message)
    click.echo(message, err=True)


def handle_signals() -> None:
    """Make SIGINT and SIGTERM end the process: by KeyboardInterrupt where a verb runs, or at once."""
    reading, writing = os.pipe()
    os.set_blocking(writing, False)
    signal.set_wakeup_fd(writing, warn_on_full_buffer=False)
    threading.Thread(target=_guard, args=(reading,), daemon=True).start()
    sys.unraisablehook = _end_if_interrupted
    threading.excepthook = _explain_unless_interrupted
    # The tracker of multiprocessing's semaphores outlives an ended process and removes them; it need not say so.
    ignored = os.environ.get("PYTHONWARNINGS", "").split(",")
    os.environ["PYTHONWARNINGS"] = ",".join(filter(None, [*ignored, "ignore:resource_tracker:UserWarning"]))
    signal.signal(_WAKING, _wake)
    for number in _ENDINGS:
        signal.signal(number, _interrupt)


def finish(code: object) -> None:
    """End a process that received a signal, without the interpreter's teardown, which may wait for threads.

    Args:
        code: Exit code of the command.

    Otherwise let signals end the process at once from here on: nothing is left to keep.
    """
    if received():
        sys.stdout.flush()
        os._exit(code if isinstance(code, int) else 1)
    for number in _ENDINGS:
        signal.signal(number, lambda number, frame: _end(signal.Signals(number)))  # noqa: ARG005


def _interrupt(number: int, frame: FrameType | None) -> None:
    if _Received.number is not None:  # a repeated signal must not interrupt the commit of finished work
        return
    _Received.number = signal.Signals(number)
    _Received.place = frame, frame.f_lasti if frame else 0
    _Received.woken = time.monotonic()
    _Received.is_handled.set()
    if not _Received.is_explained:
        _end(_Received.number)
    _end_workers()
    if not _is_delicate(frame):
        raise KeyboardInterrupt
    _Received.is_pending = True
    if engine := _engine_in(frame):
        engine.interrupt()


def _wake(number: int, frame: FrameType | None) -> None:
    """Raise the KeyboardInterrupt that was put off."""
    del number
    _Received.woken = time.monotonic()
    if _Received.is_pending and _Received.is_explained and not _is_delicate(frame):
        _Received.is_pending = False
        raise KeyboardInterrupt


def _is_delicate(frame: FrameType | None) -> bool:
    """Whether the main thread waits for a query, or imports a module."""
    names = {caller.f_globals.get("__name__") for caller in _callers(frame)}
    return not names.isdisjoint({_ENGINE, "importlib._bootstrap"})


def _engine_in(frame: FrameType | None) -> Engine | None:
    """Return the engine whose query the main thread waits for, if any."""
    for caller in _callers(frame):
        if caller.f_globals.get("__name__") == _ENGINE:
            return caller.f_locals.get("self")
    return None


def _callers(frame: FrameType | None) -> Iterator[FrameType]:
    while frame is not None:
        yield frame
        frame = frame.f_back


def _guard(pipe: int) -> None:
    """End the process if the handler does not run, if the call that it interrupts goes on, or at a second signal."""
    number = _read(pipe)
    begin = time.monotonic()
    while not _Received.is_handled.wait(_PATIENCE / 10):
        if time.monotonic() - begin > _PATIENCE:
            _end(number)
        signal.pthread_kill(threading.main_thread().ident or 0, _WAKING)
    while True:
        other = os.read(pipe, 1)[0] if select.select([pipe], [], [], _PATIENCE / 10)[0] else None
        if _Received.is_pending:
            signal.pthread_kill(threading.main_thread().ident or 0, _WAKING)
        if other in _ENDINGS:
            number = signal.Signals(other)
        is_late = _Received.is_pending and time.monotonic() - _Received.woken > _PATIENCE  # a query after an import
        if time.monotonic() - begin > _PATIENCE and (other in _ENDINGS or is_late or _is_stuck()):
            _end(number)


def _is_stuck() -> bool:
    """Whether the main thread is still in the call that the handler interrupted."""
    frame = sys._current_frames().get(threading.main_thread().ident or 0)
    return frame is not None and (frame, frame.f_lasti) == _Received.place


def _read(pipe: int) -> signal.Signals:
    """Wait for a signal that ends the process."""
    while True:
        number = os.read(pipe, 1)[0]
        if number in _ENDINGS:
            return signal.Signals(number)


def _end_if_interrupted(unraisable: Any) -> None:
    """Hook for exceptions that Python cannot raise, for example in a destructor."""
    number = received()
    if number is not None and issubclass(unraisable.exc_type, KeyboardInterrupt):
        _end(number)
    sys.__unraisablehook__(unraisable)


def _explain_unless_interrupted(arguments: threading.ExceptHookArgs) -> None:
    """Hook for exceptions of threads; those of a pool whose workers were ended are expected."""
    if not received():
        threading.__excepthook__(arguments)


def _end(number: signal.Signals) -> None:
    _end_workers()
    # Not through sys.stderr, which the main thread may have locked.
    os.write(2, f"{_ENDINGS[number]}: stopped before the end\n".encode())
    os._exit(128 + number)


def _end_workers() -> None:
    from multiprocessing import active_children

    for child in active_children():  # their unfinished files are not published yet, so no reader can see them
        child.terminate()
