"""How a worker process behaves towards the process that started it. Light, so that it takes effect at once."""

from __future__ import annotations

import os
import signal
import threading
from multiprocessing import parent_process
from multiprocessing.process import BaseProcess


def follow_parent() -> None:
    """Leave Ctrl-C, which reaches every process of a terminal, to the parent; end when the parent is gone.

    Nothing is lost by ending at once: what a worker has not finished has no name yet in the lake.
    """
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    parent = parent_process()
    if parent:
        threading.Thread(target=_end_with, args=(parent,), daemon=True).start()


def _end_with(parent: BaseProcess) -> None:
    parent.join()
    os._exit(1)
