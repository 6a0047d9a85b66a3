"""Folders for what is needed for a while: they go with the process, and what a killed one left goes with the next."""

from __future__ import annotations

import fcntl
import os
import shutil
import tempfile
import weakref
from contextlib import suppress
from pathlib import Path

_PREFIX = "scenarionet-raw-"


class Scratch:
    """An empty folder among the temporary ones.

    This process holds a lock on it, which the system releases when the process ends, however that happens: a folder
    that nobody holds is what a killed process left.

    Attributes:
        path: The folder, free of symbolic links.
    """

    def __init__(self) -> None:
        sweep()
        self.path, lock = _made()
        self._end = weakref.finalize(self, _remove, self.path, lock, os.getpid())

    def close(self) -> None:
        """Remove it now."""
        self._end()


def _made() -> tuple[Path, int]:
    """A new folder, and the lock on it."""
    while True:
        path = Path(tempfile.mkdtemp(prefix=_PREFIX)).resolve()
        with suppress(OSError):  # another process may sweep it before it is locked; then there will be another one
            lock = os.open(path, os.O_RDONLY)
            fcntl.flock(lock, fcntl.LOCK_EX)
            if path.is_dir():
                return path, lock
            os.close(lock)


def sweep() -> None:
    """Remove the folders that nobody holds."""
    for path in Path(tempfile.gettempdir()).glob(f"{_PREFIX}*"):
        with suppress(OSError):  # somebody else's, or gone meanwhile
            lock = os.open(path, os.O_RDONLY)
            try:
                fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
                shutil.rmtree(path, ignore_errors=True)
            finally:
                os.close(lock)


def _remove(path: Path, lock: int, owner: int) -> None:
    if os.getpid() == owner:  # a forked process ends without taking its parent's folder along
        shutil.rmtree(path, ignore_errors=True)
    os.close(lock)
