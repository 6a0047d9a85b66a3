"""Temporary folders that are deleted with their process, or by the next process if theirs was killed."""

from __future__ import annotations

import fcntl
import os
import shutil
import tempfile
import weakref
from contextlib import suppress
from pathlib import Path

_PREFIX = "scenarionet-raw-"


class ScratchFolder:
    """An empty folder in the system's temporary folder.

    The process holds a lock on it, which the system releases however the process ends: an unlocked
    folder was left behind by a killed process.

    Attributes:
        path: The folder, with symbolic links resolved.
    """

    def __init__(self) -> None:
        sweep()
        while True:
            self.path = Path(tempfile.mkdtemp(prefix=_PREFIX)).resolve()
            with suppress(OSError):  # another process may sweep it before it is locked: make another one
                lock = os.open(self.path, os.O_RDONLY)
                fcntl.flock(lock, fcntl.LOCK_EX)
                if self.path.is_dir():
                    break
                os.close(lock)
        self._remove = weakref.finalize(self, _remove, self.path, lock, os.getpid())

    def close(self) -> None:
        """Delete the folder now."""
        self._remove()


def sweep() -> None:
    """Delete unlocked folders."""
    for path in Path(tempfile.gettempdir()).glob(f"{_PREFIX}*"):
        with suppress(OSError):  # locked by its process, owned by another user, or already deleted
            lock = os.open(path, os.O_RDONLY)
            try:
                fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
                shutil.rmtree(path, ignore_errors=True)
            finally:
                os.close(lock)


def _remove(path: Path, lock: int, owner: int) -> None:
    if os.getpid() == owner:  # a forked process must not delete its parent's folder
        shutil.rmtree(path, ignore_errors=True)
    os.close(lock)
