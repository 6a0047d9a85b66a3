"""Startup of worker processes, their name and memory use.

Imports the standard library alone, so that a worker follows its parent before it loads anything heavy.
"""

from __future__ import annotations

import os
import platform
import resource
import signal
import sys
import threading
from multiprocessing import parent_process
from multiprocessing.process import BaseProcess
from pathlib import Path


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


def worker_name() -> str:
    """Name of this process in reports: host and process id."""
    return f"{platform.node()}-{os.getpid()}"


def peak_memory() -> int:
    """Peak resident memory of this process [bytes]."""
    try:  # ru_maxrss includes the parent's memory from before exec
        status = Path("/proc/self/status").read_text()
        return 1024 * int(status.split("VmHWM:")[1].split()[0])
    except (OSError, IndexError):
        return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * (1 if sys.platform == "darwin" else 1024)
