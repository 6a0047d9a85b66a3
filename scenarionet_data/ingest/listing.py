"""List folders of raw recordings: what cannot be listed is an error, not passed over."""

from __future__ import annotations

import os
from collections.abc import Iterator
from pathlib import Path

from scenarionet_data.errors import CorruptSource


def walk(root: Path | str) -> Iterator[tuple[str, list[str], list[str]]]:
    """Like :func:`os.walk`, which passes over folders that cannot be listed; links to folders are not followed.

    Raises:
        CorruptSource: A folder cannot be listed.
    """
    return os.walk(root, onerror=_refuse)


def _refuse(error: OSError) -> None:
    if not isinstance(error, FileNotFoundError | NotADirectoryError):  # deleted meanwhile, or RAW is a file
        raise CorruptSource(
            f"{error.filename}: cannot be listed ({error.strerror}); change its permissions, or move it out of RAW"
        ) from error
