"""Startup of worker processes.

Imports the standard library alone, so that a worker follows its parent before it loads anything heavy.
"""

from __future__ import annotations

import os
import signal
import threading
from multiprocessing import parent_process
from multiprocessing.process import BaseProcess


def follow_parent() -> None:
    """Ignore Ctrl-C, which reaches every process of a terminal; exit when the parent process exits.

    Exiting at once is safe: unfinished files have no final name in the lake yet.
    """
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    parent = parent_process()
    if parent:
        threading.Thread(target=_end_with, args=(parent,), daemon=True).start()


def _end_with(parent: BaseProcess) -> None:
    parent.join()
    os._exit(1)
