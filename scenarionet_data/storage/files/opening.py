"""Open a lake's files by path or URL."""

from __future__ import annotations

from pathlib import Path
from typing import Protocol, TypeAlias

from scenarionet_data.storage.files.lake_files import LakeFiles
from scenarionet_data.storage.files.local import LocalLakeFiles
from scenarionet_data.storage.files.places import is_url, path_of


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
        LakeError: The URL scheme is not supported.
        MissingDependency: The libraries for object stores are not installed.
    """
    if not isinstance(lake, str | Path):
        return lake.files
    if not is_url(lake):
        return LocalLakeFiles(path_of(lake, "give a URL as text"))
    from scenarionet_data.storage.files.remote import RemoteLakeFiles  # lazy: local lakes do not need it

    return RemoteLakeFiles(str(lake))
