"""The files of a lake in an object store (S3, Google Cloud Storage).

There is no rename there: a file is uploaded under its final name and is nowhere until it is whole, and a snapshot, a
database or a layer is put on the condition that none of that name exists. Published files never change, so whoever
needs a whole file works on a copy on this machine; the big tables are read in place, by byte ranges.
"""

from __future__ import annotations

import hashlib
import time
from collections.abc import Callable, Iterable, Sequence
from concurrent.futures import Future
from functools import cached_property
from pathlib import Path
from typing import Any, TypeVar

import pyarrow as pa
import pyarrow.parquet as pq

from scenarionet_data.errors import FileGone
from scenarionet_data.storage.files import object_store
from scenarionet_data.storage.files.cache import LocalCopies, folder_of
from scenarionet_data.storage.files.errors import reading, writing
from scenarionet_data.storage.files.local import LakeFiles, Listed, open_files
from scenarionet_data.storage.files.object_store import ObjectStore
from scenarionet_data.storage.files.requests import Requests

FOOTER = 2**17
"""Bytes asked of the end of a file to have its footer: those of 64 row groups are 60-100 kB."""

_BY_CONTENT = ("tracks/", "lights/", "maps/", "quarantine/")
"""Their files' names end in a digest of the content; others may be dropped, and made again under the same name."""

_READ_IN_PLACE = ("tracks/", "lights/", "maps/")

_YOUNG = 3600.0
"""Files that were put there within the last hour [s] need not be put again to be young: ``vacuum`` waits a day."""

Given = TypeVar("Given")
Made = TypeVar("Made")


class RemoteLakeFiles(LakeFiles):
    """Files below a URL.

    Args:
        url: For example ``s3://bucket/lake``.

    Raises:
        LakeError: The URL is of a kind that is not known.
        MissingDependency: obstore is not installed.
    """

    def __init__(self, url: str) -> None:
        self.root = self._url = url.rstrip("/")
        self._store = ObjectStore(self._url)
        self._folder = folder_of(f"{object_store.endpoint()} {self._url}")
        self._copies = LocalCopies(self._folder)
        self._marks: dict[str, str] = {}

    def __reduce__(self) -> tuple[Any, ...]:
        return open_files, (self._url,)

    # --- many requests at once --------------------------------------------------------------------------

    @cached_property
    def _requests(self) -> Requests:
        return Requests(lambda: self._store.answer_time)

    def start(self, do: Callable[..., Made], *given: Any) -> Future[Made]:
        """Do something in another thread; for requests, which mostly wait."""
        return self._requests.start(do, *given)

    def side_by_side(self, do: Callable[[Given], Made], given: Iterable[Given]) -> list[Made]:
        """What ``do`` makes of each, many at once."""
        return self._requests.side_by_side(do, given)

    # --- what is there ----------------------------------------------------------------------------------

    def url(self, name: str) -> str:
        """Its URL."""
        return f"{self._url}/{name}"

    def names(self, folder: str, suffix: str = "") -> list[str]:
        """Files directly in ``folder``, sorted; empty when there is no such folder."""
        found, _ = self._store.list(folder)
        self._marks |= {each.name: each.mark for each in found}
        return sorted(each.name for each in found if each.name.endswith(suffix))

    def folders(self, folder: str) -> list[str]:
        """Names of the folders directly in ``folder``, sorted."""
        return sorted(self._store.list(folder)[1])

    def listing(self, folder: str) -> list[Listed]:
        """Every file below a folder, at any depth, in any order."""
        return [Listed(each.name, each.size, each.modified) for each in self._store.walk(folder)]

    def size(self, name: str) -> int | None:
        """Bytes of a file; None when it is not there."""
        found = self._store.find(name)
        if found is None:
            return None
        self._marks[name] = found.mark
        return found.size

    def sizes(self, names: Sequence[str]) -> list[int | None]:
        """Like :meth:`size`, asked side by side."""
        return self.side_by_side(self.size, names)

    # --- reading ----------------------------------------------------------------------------------------

    def path(self, name: str) -> Path:
        """A copy of a file on this machine.

        Raises:
            FileGone: It is not there.
            LakeError: The store does not answer.
        """
        if not name.startswith(_BY_CONTENT) and name not in self._marks:
            self.size(name)
        copy = self._copies.find(name, self._mark(name))
        return copy or self._download(name)

    def paths(self, names: Sequence[str]) -> list[Path]:
        """Copies of many files, fetched side by side."""
        return self.side_by_side(self.path, names)

    def _mark(self, name: str) -> str:
        """What tells a file's content from that of another of the same name; "" when the name does."""
        return "" if name.startswith(_BY_CONTENT) else self._marks.get(name, "")

    def _download(self, name: str) -> Path:
        temporary = self.temporary()
        self._marks[name] = self._store.download(name, temporary).mark
        return self._copies.add(temporary, name, self._mark(name))

    def digest(self, name: str) -> str:
        """SHA-256 of a file as it is in the store, hexadecimal; it is not kept."""
        found = hashlib.sha256()
        for piece in self._store.pieces(name):
            found.update(piece)
        return found.hexdigest()

    def footer(self, name: str) -> pq.FileMetaData:
        """Footer of a Parquet file."""
        if not name.startswith(_READ_IN_PLACE):
            return super().footer(name)
        with reading(self.url(name)):
            return pq.read_metadata(pa.BufferReader(self.end(name)[1]))

    def end(self, name: str) -> tuple[int, bytes]:
        """Size and last bytes of one of the big Parquet files, whose content its name tells: all of its footer."""
        size, end = self._last(name, FOOTER)
        needed = int.from_bytes(end[-8:-4], "little") + 8
        return (size, end) if needed <= len(end) or len(end) == size else self._last(name, needed)

    def _last(self, name: str, length: int) -> tuple[int, bytes]:
        """Size and at most the last ``length`` bytes; kept, with the size in front."""
        copy = self._copies.find(f"{name}.end", str(length))
        if copy is None:
            size, end = self._store.last(name, length)
            temporary = self.temporary()
            with writing(temporary, temporary):
                temporary.write_bytes(size.to_bytes(8, "little") + end)
            copy = self._copies.add(temporary, f"{name}.end", str(length))
        kept = copy.read_bytes()
        return int.from_bytes(kept[:8], "little"), kept[8:]

    def range(self, name: str, start: int, end: int) -> memoryview:
        """Bytes ``start`` to ``end`` (exclusive) of a file."""
        return self._store.range(name, start, end)

    def scans(self, names: Sequence[str]) -> list[str]:
        """URLs of big files, paths of copies of small ones."""
        small = [name for name in names if not name.startswith(_READ_IN_PLACE)]
        copies = dict(zip(small, self.paths(small), strict=True))
        return [str(copies[name]) if name in copies else self.url(name) for name in names]

    @property
    def scanned_folders(self) -> list[str]:
        """The lake, and its copies on this machine."""
        return [f"{self._url}/", f"{self._folder}/"]

    def filesystem(self) -> Any:
        """The lake as an fsspec file system."""
        from scenarionet_data.storage.files.fsspec_adapter import RemoteFilesystem  # here: fsspec is of the extra, too

        return RemoteFilesystem(self)

    # --- writing ----------------------------------------------------------------------------------------

    def publish(self, temporary: Path, name: str) -> None:
        """Upload a complete temporary file: at once and for good."""
        try:
            self._marks[name] = self._store.put(name, temporary)
        except BaseException:
            temporary.unlink(missing_ok=True)
            raise
        if name.startswith(_READ_IN_PLACE):
            temporary.unlink()
        else:  # small files are soon read again: what was uploaded becomes the copy
            self._copies.add(temporary, name, self._mark(name))

    def publish_new(self, name: str, data: bytes | Path) -> bool:
        """Upload ``data`` (bytes, or a temporary file) unless a file of that name exists.

        A temporary file that is not published stays: it may get another name.

        Returns:
            Whether this call made the file; exactly one of several concurrent callers does.
        """
        is_made = self._store.create(name, data.read_bytes() if isinstance(data, Path) else data)
        self._marks.pop(name, None)
        if is_made and isinstance(data, Path):
            data.unlink()
        return is_made

    def move(self, folder: str, name: str) -> bool:
        """Give a folder another name, file by file, the old one last; returns whether that name was free."""
        listed = self.names(folder)
        if self.names(name):
            return False
        for old in listed:
            if not self.publish_new(f"{name}/{old.rpartition('/')[2]}", self.path(old).read_bytes()):
                return False
        self._store.delete(listed)
        return True

    def remove(self, name: str) -> None:
        """Remove a file or folder."""
        gone = [each.name for each in self._store.walk(name)] or [name]
        self._store.delete(gone)
        for each in gone:
            self._marks.pop(each, None)

    def renew(self, names: Iterable[str]) -> list[str]:
        """Make published files young, so that no ``vacuum`` takes them: what is not, is put again.

        Returns:
            Those that are gone.
        """
        listed = list(names)
        there = self.side_by_side(self._renewed, listed)
        return [name for name, is_there in zip(listed, there, strict=True) if not is_there]

    def _renewed(self, name: str) -> bool:
        """Whether a file is there, now that it is young."""
        found = self._store.find(name)
        if found is None or time.time() - found.modified < _YOUNG:
            return found is not None
        try:
            self._marks[name] = self._store.put(name, self.path(name))
        except FileGone:
            return False
        return True

    def remove_unchanged(self, listed: Listed) -> bool:
        """Remove a file unless it has been published or renewed since it was listed; returns whether it did."""
        found = self._store.find(listed.name)
        if found is None or found.modified != listed.modified:
            return False
        self.remove(listed.name)
        return True
