"""Downloads of raw recordings on a worker: the files of the current shard, reused for the next one."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager, suppress
from fnmatch import fnmatchcase
from pathlib import PurePosixPath
from typing import Any

from scenarionet_data.conversion.remote_raw.mirror import MAX_CONNECTIONS, bucket_of, relocated, rename_paths
from scenarionet_data.conversion.remote_raw.scratch import ScratchFolder, sweep
from scenarionet_data.converters.base import Converter
from scenarionet_data.errors import FileGone, SourceNotFound
from scenarionet_data.ingest.shard import Shard
from scenarionet_data.storage.files.errors import writing
from scenarionet_data.storage.files.object_store import ObjectStore

_idle: list[_Downloads] = []
"""Downloads of this process that no shard is using; more than one only with several threads."""


@contextmanager
def local_copy(converter: Converter[Any], shard: Shard) -> Iterator[Shard]:
    """The shard with its files downloaded from the object store.

    Downloads are kept until the next shard: files that both need are downloaded once, the others are deleted then.

    Raises:
        SourceNotFound: A file was deleted since it was listed.
        LakeError: The store does not answer, or the local disk is full.
    """
    downloads = _take(bucket_of(shard.root))
    try:
        yield downloads.fetch(converter, shard)
    except Exception as error:
        rename_paths(error, downloads.folder, downloads.bucket)
        raise
    finally:
        _idle.append(downloads)


def _take(bucket: str) -> _Downloads:
    """Reuse idle downloads of a bucket, or create them; delete downloads of other buckets."""
    with suppress(IndexError):
        while True:
            downloads = _idle.pop()  # atomic: no other thread takes the same ones
            if downloads.bucket == bucket:
                return downloads
            downloads.close()
    return _Downloads(bucket)


def remove_downloads() -> None:
    """Delete the idle downloads of this process, and those that killed processes left behind."""
    with suppress(IndexError):
        while True:
            _idle.pop().close()
    sweep()


class _Downloads:
    """Files of a bucket, in a folder with the same structure.

    A file is complete once its ETag is recorded.

    Attributes:
        bucket: The bucket's URL.
        folder: The folder.
    """

    def __init__(self, bucket: str) -> None:
        self.bucket = bucket
        self._store = ObjectStore(bucket)
        self._scratch = ScratchFolder()
        self.folder = str(self._scratch.path)
        self._marks: dict[str, str] = {}

    def close(self) -> None:
        self._scratch.close()

    def fetch(self, converter: Converter[Any], shard: Shard) -> Shard:
        """Download a shard's files, delete all others, and return the shard with local paths."""
        local = relocated(shard, self.bucket, self.folder)
        root = PurePosixPath(local.root).relative_to(self.folder)
        items = {str(root / item.name) for item in shard.items}
        needed: set[str] = set()
        with ThreadPoolExecutor(MAX_CONNECTIONS) as pool:
            for batch in converter.files(local) if shard.split else [[item.name for item in shard.items]]:
                names = {each for name in batch for each in self._matching(str(root / name))} - needed
                needed |= names
                list(pool.map(self._download, sorted(names)))
                for name in items & names:
                    if name not in self._marks:
                        raise SourceNotFound(
                            f"{self.bucket}/{name}: deleted since it was listed; run the same command again"
                        )
        for name in self._marks.keys() - needed:
            del self._marks[name]
            path = self._scratch.path / name
            path.unlink(missing_ok=True)
            with suppress(OSError):  # folders that are not empty stay
                for folder in path.relative_to(self._scratch.path).parents[:-1]:
                    (self._scratch.path / folder).rmdir()
        return local

    def _matching(self, name: str) -> Iterable[str]:
        """The name itself, or for a pattern the names of matching files in its folder."""
        folder, _, last = name.rpartition("/")
        if "*" not in last:
            return [name]
        names = [each.name for each in self._store.list(folder or ".")[0]]
        return [each for each in names if fnmatchcase(each.rpartition("/")[2], last)]

    def _download(self, name: str) -> None:
        """Download a file unless an unchanged copy exists; skip files missing from the store."""
        path, known = self._scratch.path / name, self._marks.get(name)
        if known is not None:
            found = self._store.find(name)
            if found and found.mark == known and path.is_file():
                return
            del self._marks[name]
        with writing(path):
            path.unlink(missing_ok=True)
            path.parent.mkdir(parents=True, exist_ok=True)
        with suppress(FileGone):
            self._marks[name] = self._store.download(name, path).mark
