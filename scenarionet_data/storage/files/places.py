"""Paths and URLs, as users give them, and the files of a lake there; imports no large package before it opens one."""

from __future__ import annotations

import re
from pathlib import Path
from typing import TYPE_CHECKING, Protocol, TypeAlias
from urllib.parse import unquote, urlsplit

from scenarionet_data.errors import BadParameter

if TYPE_CHECKING:
    from scenarionet_data.storage.files.lake_files import LakeFiles

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
        BadParameter: It is no path, a URL that became one, or not UTF-8.
    """
    if not isinstance(place, str | Path):
        raise BadParameter(f"expected a path, found {place!r}; {remedy}")
    if isinstance(place, Path) and _SHORTENED_URL.match(place.as_posix()):
        raise BadParameter(f"{place}: a URL that became a path, which has lost a slash; {remedy}")
    url = _FILE_URL.match(str(place))
    path = Path(unquote(urlsplit(str(place)).path)) if url else Path(place)
    try:
        str(path).encode()
    except UnicodeEncodeError as error:
        raise BadParameter(f"{path}: the path is not UTF-8; rename the folder, or give another one") from error
    return path


class HasFiles(Protocol):
    """An open lake, such as :class:`scenarionet_data.Lake`."""

    @property
    def files(self) -> LakeFiles:
        """Files of the lake."""
        ...


LakeFilesLike: TypeAlias = HasFiles | str | Path
"""An open lake, or a lake's folder or URL."""


def open_files(lake: LakeFilesLike) -> LakeFiles:
    """Files of a lake: an open one, or by its folder or URL (``lake``, ``file:///data/lake``, ``s3://bucket/lake``).

    Raises:
        BadParameter: It is no lake, nor a path or URL.
        LakeError: The URL scheme is not supported.
        MissingDependency: The libraries for object stores are not installed.
    """
    if not isinstance(lake, str | Path):
        if not hasattr(lake, "files"):
            raise BadParameter(f"expected a lake, its path or its URL, found {lake!r}")
        return lake.files
    if not is_url(lake):
        from scenarionet_data.storage.files.local import (
            LocalLakeFiles,  # lazy: paths are checked before Arrow is needed
        )

        return LocalLakeFiles(path_of(lake, "give a URL as text"))
    from scenarionet_data.storage.files.remote import RemoteLakeFiles  # lazy: local lakes do not need it

    return RemoteLakeFiles(str(lake))
