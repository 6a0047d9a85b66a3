"""How a worker process behaves towards the process that started it, and what is known of it. Light: it acts at once."""

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


def worker_name() -> str:
    """What this process is called in reports: machine and process."""
    return f"{platform.node()}-{os.getpid()}"


def peak_memory() -> int:
    """The most resident memory this process ever had [bytes]."""
    try:  # ru_maxrss would count what its parent had before it became this process
        status = Path("/proc/self/status").read_text()
        return 1024 * int(status.split("VmHWM:")[1].split()[0])
    except (OSError, IndexError):
        return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * (1 if sys.platform == "darwin" else 1024)
