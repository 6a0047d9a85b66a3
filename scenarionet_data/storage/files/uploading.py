"""Upload a folder written on this machine to an object store, for output that is not a lake of its own."""

from __future__ import annotations

from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

from scenarionet_data.storage.files.object_store import ObjectStore

_CONNECTIONS = 16


class RemoteFolder:
    """A folder in an object store.

    Args:
        url: For example ``s3://bucket/exported``.

    Raises:
        LakeError: The URL scheme is not supported.
        MissingDependency: obstore is not installed.
    """

    def __init__(self, url: str) -> None:
        self.url = url.rstrip("/")
        self._store = ObjectStore(self.url)

    def names(self) -> list[str]:
        """Every file below the URL."""
        return [each.name for each in self._store.walk()]

    def upload(self, folder: Path, last: Sequence[str]) -> None:
        """Make the folder's content equal to that of a local one.

        Args:
            folder: The local folder.
            last: Files to upload in this order when all others are there: those by which readers recognise a complete
                folder. Earlier ones are removed first, so that readers never find them with other files.
        """
        before = self.names()
        names = sorted(path.relative_to(folder).as_posix() for path in folder.rglob("*") if path.is_file())
        self._store.delete([name for name in before if name in last])
        with ThreadPoolExecutor(_CONNECTIONS) as pool:
            list(pool.map(lambda name: self._store.put(name, folder / name), (n for n in names if n not in last)))
        for name in last:
            self._store.put(name, folder / name)
        self._store.delete([*{*before} - {*names}])
