"""Calls of planners, which must end neither the process nor never."""

from __future__ import annotations

import os
import signal
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType
from typing import NoReturn

from scenarionet_data.errors import BadParameter


@contextmanager
def supervised(name: str, limit: float) -> Iterator[None]:
    """Make an exit, and more time than a limit, an error of the scenario.

    A call is interrupted in the main thread, on systems with ``signal.setitimer``; elsewhere its time is compared with
    the limit when it returns.

    Args:
        name: What is called.
        limit: [s].

    Raises:
        BadParameter: It exits.
        TimeoutError: It takes longer.
    """

    def leave(status: int) -> NoReturn:
        raise SystemExit(status)

    def stop(_signal: int, _frame: FrameType | None) -> NoReturn:
        raise TimeoutError

    is_interrupted = threading.current_thread() is threading.main_thread() and hasattr(signal, "setitimer")
    end_process, os._exit, started = os._exit, leave, time.perf_counter()
    before = signal.signal(signal.SIGALRM, stop) if is_interrupted else None
    try:
        if is_interrupted:
            signal.setitimer(signal.ITIMER_REAL, limit)
        yield
        if time.perf_counter() - started > limit:
            raise TimeoutError
    except TimeoutError as error:
        raise TimeoutError(
            f"{name} took more than {limit:g} s; raise step_limit or episode_limit of Planned"
        ) from error
    except SystemExit as error:
        raise BadParameter(f"{name} called exit({error.code}); return an action, or raise an error") from error
    finally:
        os._exit = end_process
        if is_interrupted:
            signal.setitimer(signal.ITIMER_REAL, 0.0)
            signal.signal(signal.SIGALRM, before)
