"""Copies of an object store's files on this machine: published files never change, so each is fetched once.

Processes share the folder. A copy appears whole under its name; the least recently used make way when there is more
than fits, but none that was used within the last hour, because somebody may be about to open it.
"""

from __future__ import annotations

import hashlib
import os
import time
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path

from scenarionet_data.storage.files.errors import writing

_KEPT_FOR = 3600.0
_LOOKED_AT_EVERY = 64 * 2**20
"""Bytes of new copies after which the room is looked at again."""


def folder_of(place: str) -> Path:
    """Where copies of a lake lie: below ``$SCENARIONET_CACHE``, or the user's folder for caches."""
    told = os.environ.get("SCENARIONET_CACHE")
    root = Path(told) if told else Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "scenarionet"
    return root.resolve() / hashlib.blake2b(place.encode(), digest_size=8).hexdigest()


def room() -> int:
    """Bytes that the copies of all lakes together may take: ``$SCENARIONET_CACHE_GB``, 20 GB unless it is set."""
    return int(float(os.environ.get("SCENARIONET_CACHE_GB") or 20) * 1e9)


class LocalCopies:
    """Copies of one lake's files.

    Args:
        folder: Of :func:`folder_of`.
    """

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self._unseen = _LOOKED_AT_EVERY  # so that the first new copy looks at the room

    def find(self, name: str, mark: str) -> Path | None:
        """The copy of a file whose content has this mark; None when there is none."""
        path = self._path(name, mark)
        try:
            os.utime(path)
        except OSError:
            return None
        return path

    def add(self, temporary: Path, name: str, mark: str) -> Path:
        """Keep a complete temporary file as a copy."""
        path = self._path(name, mark)
        with writing(path, temporary):
            self._unseen += temporary.stat().st_size
            path.parent.mkdir(parents=True, exist_ok=True)
            temporary.replace(path)
        if self._unseen >= _LOOKED_AT_EVERY:
            self._unseen = 0
            make_room(self.folder.parent, room())
        return path

    def _path(self, name: str, mark: str) -> Path:
        digest = hashlib.blake2b(mark.encode(), digest_size=6).hexdigest()
        return self.folder / "copies" / digest / name


def make_room(folder: Path, room: int) -> None:
    """Remove the least recently used copies until they take no more than ``room`` bytes."""
    listed = sorted(_copies(folder))
    size = sum(size for _, size, _ in listed)
    for used, taken, path in listed:
        if size <= room or used > time.time() - _KEPT_FOR:
            return
        with suppress(FileNotFoundError):  # another process makes room, too
            Path(path).unlink()
        size -= taken


def _copies(folder: Path) -> Iterator[tuple[float, int, str]]:
    """Time of last use, size and path of every copy of every lake."""
    for copies in folder.glob("*/copies"):
        for path in copies.rglob("*"):
            with suppress(FileNotFoundError):
                found = path.stat()
                if path.is_file():
                    yield found.st_mtime, found.st_size, str(path)
