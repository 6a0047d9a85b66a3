"""Paths and URLs, as users give them; imports no large package."""

from __future__ import annotations

import re
from pathlib import Path
from urllib.parse import unquote, urlsplit

from scenarionet_data.errors import BadParameter

_FILE_URL = re.compile(r"file://(localhost)?/")
_SHORTENED_URL = re.compile(r"[a-z][a-z0-9]+:/")
"""How ``pathlib`` writes a URL."""


def is_url(place: str | Path) -> bool:
    """Whether a place is a URL in an object store, as opposed to a path or a ``file://`` URL."""
    return isinstance(place, str) and "://" in place and not _FILE_URL.match(place)


def local_path(place: str | Path, what: str) -> Path:
    """Path of a file to write on this machine.

    Args:
        place: The path, or its ``file://`` URL.
        what: What is written, for the message, for example ``"a report"``.

    Raises:
        BadParameter: It is a URL in an object store.
    """
    remedy = f"{what} is written to this machine: give a path, then copy the file to the object store"
    if is_url(place):
        raise BadParameter(f"{place}: {remedy}")
    return path_of(place, remedy)


def path_of(place: str | Path, remedy: str) -> Path:
    """Path of a place on this machine.

    Args:
        place: The path, or its ``file://`` URL.
        remedy: End of the message.

    Raises:
        BadParameter: It is a URL that became a path, or not UTF-8.
    """
    if isinstance(place, Path) and _SHORTENED_URL.match(place.as_posix()):
        raise BadParameter(f"{place}: a URL that became a path, which has lost a slash; {remedy}")
    url = _FILE_URL.match(str(place))
    path = Path(unquote(urlsplit(str(place)).path)) if url else Path(place)
    try:
        str(path).encode()
    except UnicodeEncodeError as error:
        raise BadParameter(f"{path}: the path is not UTF-8; rename the folder, or give another one") from error
    return path
