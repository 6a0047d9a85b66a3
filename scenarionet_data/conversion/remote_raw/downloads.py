"""What a worker has of raw recordings in an object store: the files of the shard it converts, and of the one before."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager, suppress
from fnmatch import fnmatchcase
from pathlib import PurePosixPath
from typing import Any

from scenarionet_data.conversion.remote_raw.listing import AT_ONCE, bucket_of, moved, rename
from scenarionet_data.conversion.remote_raw.scratch import Scratch, sweep
from scenarionet_data.converters.base import Converter
from scenarionet_data.errors import FileGone, SourceNotFound
from scenarionet_data.ingest.shard import Shard
from scenarionet_data.storage.files.errors import writing
from scenarionet_data.storage.files.object_store import ObjectStore
from scenarionet_data.storage.files.opening import is_url

_idle: list[_Downloads] = []
"""Those that no shard of this process is converted from at the moment; one, unless it has several threads."""


@contextmanager
def at_hand(converter: Converter[Any], shard: Shard) -> Iterator[Shard]:
    """The shard with its files on this machine.

    What was downloaded stays until the next shard, so that what both need is fetched once, and what only the last one
    needed goes then.

    Raises:
        SourceNotFound: A file is gone since it was listed.
        LakeError: The store does not answer, or this machine's disk is full.
    """
    if not is_url(shard.root):
        yield shard
        return
    downloads = _taken(bucket_of(shard.root))
    try:
        yield downloads.bring(converter, shard)
    except Exception as error:
        rename(error, downloads.folder, downloads.bucket)
        raise
    finally:
        _idle.append(downloads)


def _taken(bucket: str) -> _Downloads:
    """Idle downloads of a bucket, or new ones; those of other buckets go."""
    with suppress(IndexError):
        while True:
            downloads = _idle.pop()  # one step, so that no other thread takes them too
            if downloads.bucket == bucket:
                return downloads
            downloads.close()
    return _Downloads(bucket)


def forget() -> None:
    """Remove what this process has downloaded and does not need at the moment."""
    with suppress(IndexError):
        while True:
            _idle.pop().close()


@contextmanager
def kept_meanwhile() -> Iterator[None]:
    """Whatever this process downloads is gone afterwards, and whatever killed ones left."""
    try:
        yield
    finally:
        forget()
        sweep()


class _Downloads:
    """Files of a bucket, in a folder that looks like it.

    A file counts as there when all of it is: then its mark is known.

    Attributes:
        bucket: The bucket's URL.
        folder: The folder.
    """

    def __init__(self, bucket: str) -> None:
        self.bucket = bucket
        self._store = ObjectStore(bucket)
        self._scratch = Scratch()
        self.folder = str(self._scratch.path)
        self._marks: dict[str, str] = {}

    def close(self) -> None:
        self._scratch.close()

    def bring(self, converter: Converter[Any], shard: Shard) -> Shard:
        """Bring a shard's files here, remove all others, and say where the shard lies now."""
        here = moved(shard, self.bucket, self.folder)
        root = PurePosixPath(here.root).relative_to(self.folder)
        listed = {str(root / item.name) for item in shard.items}
        asked: set[str] = set()
        with ThreadPoolExecutor(AT_ONCE) as pool:
            for batch in converter.files(here) if shard.split else [[item.name for item in shard.items]]:
                names = {each for name in batch for each in self._matching(str(root / name))} - asked
                asked |= names
                list(pool.map(self._bring, sorted(names)))
                self._refuse_lost(listed & names)
        self._remove(self._marks.keys() - asked)
        return here

    def _matching(self, name: str) -> Iterable[str]:
        """The name itself, or the names of the files in its folder that fit it as a pattern."""
        folder, _, last = name.rpartition("/")
        if "*" not in last:
            return [name]
        names = [each.name for each in self._store.list(folder or ".")[0]]
        return [each for each in names if fnmatchcase(each.rpartition("/")[2], last)]

    def _bring(self, name: str) -> None:
        """Fetch a file unless it is here, unchanged; what the store does not have is not here either."""
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

    def _refuse_lost(self, names: Iterable[str]) -> None:
        for name in names:
            if name not in self._marks:
                raise SourceNotFound(f"{self.bucket}/{name}: gone since it was listed; run the same command again")

    def _remove(self, names: Iterable[str]) -> None:
        for name in list(names):
            del self._marks[name]
            path = self._scratch.path / name
            path.unlink(missing_ok=True)
            with suppress(OSError):  # a folder that is not empty stays
                for folder in path.relative_to(self._scratch.path).parents[:-1]:
                    (self._scratch.path / folder).rmdir()
