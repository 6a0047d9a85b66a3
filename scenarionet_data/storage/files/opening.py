"""Open a lake's files by path or URL."""

from __future__ import annotations

from pathlib import Path
from urllib.parse import unquote, urlsplit

from scenarionet_data.storage.files.lake_files import LakeFiles
from scenarionet_data.storage.files.local import LocalLakeFiles


def open_files(root: str | Path) -> LakeFiles:
    """Files of a lake by its folder or URL: ``lake``, ``file:///data/lake``, ``s3://bucket/lake``, ``gs://...``.

    Raises:
        LakeError: The URL scheme is not supported.
        MissingDependency: The libraries for object stores are not installed.
    """
    if not is_url(root):
        return LocalLakeFiles(root)
    parts = urlsplit(str(root))
    if parts.scheme == "file" and parts.netloc in ("", "localhost"):
        return LocalLakeFiles(unquote(parts.path))
    from scenarionet_data.storage.files.remote import RemoteLakeFiles  # lazy: local lakes do not need it

    return RemoteLakeFiles(str(root))


def is_url(place: str | Path) -> bool:
    """Whether a place is given as a URL rather than a path."""
    return isinstance(place, str) and "://" in place
