"""List folders of raw recordings: what cannot be listed is an error, not passed over; keep what was read of files."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator
from functools import lru_cache, wraps
from pathlib import Path
from typing import ParamSpec, TypeVar

from scenarionet_data.errors import CorruptSource

Parameters = ParamSpec("Parameters")
FileContent = TypeVar("FileContent")


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


def cached_by_file(kept: int) -> Callable[[Callable[Parameters, FileContent]], Callable[Parameters, FileContent]]:
    """Keep the last results of a function of files in this process; a file that has changed is read again.

    Args:
        kept: Number of results.
    """

    def decorate(function: Callable[Parameters, FileContent]) -> Callable[Parameters, FileContent]:
        cached: Callable[..., FileContent] = lru_cache(kept)(lambda _, *given, **named: function(*given, **named))

        @wraps(function)
        def read(*given: Parameters.args, **named: Parameters.kwargs) -> FileContent:
            found = [path.stat() for path in given if isinstance(path, Path) and path.is_file()]
            states = tuple((each.st_size, each.st_mtime_ns, each.st_ino) for each in found)
            return cached(states, *given, **named)

        return read

    return decorate
