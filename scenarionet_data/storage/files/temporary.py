"""Temporary files: written first, then published under their final names."""

from __future__ import annotations

import os
import shutil
import time
import uuid
from contextlib import suppress
from pathlib import Path

from scenarionet_data.storage.files.durability import make_folder
from scenarionet_data.storage.files.errors import writing

_ABANDONED_AFTER = 24 * 3600.0


class TemporaryFolder:
    """A folder ``.tmp`` for unfinished files.

    Args:
        parent: The folder that contains it.
    """

    def __init__(self, parent: Path) -> None:
        self._folder = parent / ".tmp"

    def new(self) -> Path:
        """A new path, unique among all processes."""
        with writing(self._folder):
            make_folder(self._folder)
        return self._folder / f"{os.getpid()}-{uuid.uuid4().hex}"

    def sweep(self) -> None:
        """Remove what a killed job left more than a day ago."""
        for path in self._folder.glob("*"):
            with suppress(FileNotFoundError):  # another job has removed or published it
                if time.time() - path.stat().st_mtime > _ABANDONED_AFTER:
                    delete(path)


def delete(path: Path) -> None:
    """Remove a file or folder."""
    if path.is_dir():
        shutil.rmtree(path)
    else:
        path.unlink()
