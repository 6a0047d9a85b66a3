"""Local cache of an object store's files: published files never change, so each is downloaded once.

Processes share the cache folder. A copy appears under its name when it is complete. When the cache is full, the least
recently used copies are removed, except those used within the last hour, which another process may be about to open.
"""

from __future__ import annotations

import hashlib
import os
import time
from contextlib import suppress
from pathlib import Path

from scenarionet_data.storage.files.errors import writing

_KEPT_FOR = 3600.0
_CHECK_EVERY = 64 * 2**20
"""Bytes added to the cache after which its size is checked."""


def folder_of(place: str) -> Path:
    """Cache folder of a lake, below ``$SCENARIONET_CACHE`` or the user's cache folder."""
    chosen = os.environ.get("SCENARIONET_CACHE")
    root = Path(chosen) if chosen else Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "scenarionet"
    return root.resolve() / hashlib.blake2b(place.encode(), digest_size=8).hexdigest()


def room() -> int:
    """Maximum size of the cache for all lakes together [bytes]: ``$SCENARIONET_CACHE_GB``, by default 20 GB."""
    return int(float(os.environ.get("SCENARIONET_CACHE_GB") or 20) * 1e9)


class LocalCopies:
    """Cached copies of one lake's files.

    Args:
        folder: The result of :func:`folder_of`.
    """

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self._unchecked = _CHECK_EVERY  # check the size at the first new copy

    def find(self, name: str, mark: str, size: int | None = None) -> Path | None:
        """Path of the cached copy of a file with this ETag; None when it is not cached, or not of this size."""
        path = self._path(name, mark)
        try:
            os.utime(path)
        except OSError:
            return None
        return path if size in (None, path.stat().st_size) else None  # this machine may have failed while writing it

    def add(self, temporary: Path, name: str, mark: str) -> Path:
        """Move a complete temporary file into the cache."""
        path = self._path(name, mark)
        with writing(path, temporary):
            self._unchecked += temporary.stat().st_size
            path.parent.mkdir(parents=True, exist_ok=True)
            temporary.replace(path)
        if self._unchecked >= _CHECK_EVERY:
            self._unchecked = 0
            make_room(self.folder.parent, room())
        return path

    def discard(self, name: str, mark: str) -> bool:
        """Remove the cached copy of a file; returns whether there was one."""
        try:
            self._path(name, mark).unlink()
        except FileNotFoundError:
            return False
        return True

    def _path(self, name: str, mark: str) -> Path:
        digest = hashlib.blake2b(mark.encode(), digest_size=6).hexdigest()
        return self.folder / "copies" / digest / name


def make_room(folder: Path, room: int) -> None:
    """Remove the least recently used copies until they take no more than ``room`` bytes."""
    listed = list[tuple[float, int, Path]]()  # time of last use, size and path of every copy of every lake
    for path in folder.glob("*/copies/**/*"):
        with suppress(FileNotFoundError):
            found = path.stat()
            if path.is_file():
                listed.append((found.st_mtime, found.st_size, path))
    listed.sort()
    size = sum(size for _, size, _ in listed)
    for used, taken, path in listed:
        if size <= room or used > time.time() - _KEPT_FOR:
            return
        with suppress(FileNotFoundError):  # removed by another process
            path.unlink()
        size -= taken
