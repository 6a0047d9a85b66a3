"""Files of a lake in an object store (S3, Google Cloud Storage).

Object stores cannot rename: a file is uploaded under its final name and visible once it is complete. Snapshots,
databases and user columns are created by conditional puts that fail when the name exists. Published files never
change, so files that are read whole are cached on this machine; row groups of the large tables are read by byte range.
"""

from __future__ import annotations

import hashlib
import time
from collections.abc import Callable, Iterable, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from functools import cached_property
from pathlib import Path
from typing import Any, TypeVar

import pyarrow as pa

from scenarionet_data.errors import FileGone, LakeError
from scenarionet_data.storage.files import store_client
from scenarionet_data.storage.files.cache import LocalCopies, folder_of
from scenarionet_data.storage.files.errors import writing
from scenarionet_data.storage.files.lake_files import READ_IN_PLACE, LakeFiles, Listed, delete
from scenarionet_data.storage.files.object_store import ObjectStore, Stored
from scenarionet_data.storage.integrity import seals
from scenarionet_data.storage.integrity.file_end import FileEnd

FOOTER = 2**17
"""Bytes requested from the end of a file for its footer; one with 64 row groups is 60-100 kB."""

_BY_CONTENT = ("tracks/", "lights/", "maps/", "quarantine/", "defects/")
"""Tables whose file names contain a digest of the content; other files may be dropped and re-created."""

_CONCURRENT_REQUESTS = 16
"""Measured: adapting this number to the latency of the store gains at most 17 % (0 to 50 ms)."""

_YOUNG = 3600.0
"""Files uploaded within the last hour [s] need no renewal: ``vacuum`` spares files younger than a day."""

Argument = TypeVar("Argument")
Result = TypeVar("Result")


class RemoteLakeFiles(LakeFiles):
    """Files below a URL.

    Args:
        url: For example ``s3://bucket/lake``.

    Raises:
        LakeError: The URL scheme is not supported.
        MissingDependency: obstore is not installed.
    """

    def __init__(self, url: str) -> None:
        self.root = self._url = url.rstrip("/")
        self._store = ObjectStore(self._url)
        self._folder = folder_of(f"{store_client.endpoint()} {self._url}")
        self._copies = LocalCopies(self._folder)
        self.scanned_folders = [f"{self._url}/", f"{self._folder}/"]
        self._marks: dict[str, str] = {}
        self._sizes: dict[str, int] = {}

    def __reduce__(self) -> tuple[Any, ...]:
        return RemoteLakeFiles, (self._url,)

    # --- concurrent requests ----------------------------------------------------------------------------

    @cached_property
    def _threads(self) -> ThreadPoolExecutor:
        return ThreadPoolExecutor(_CONCURRENT_REQUESTS, "scenarionet-requests")

    def submit(self, function: Callable[..., Result], *arguments: Any) -> Future[Result]:
        """Run a function that makes a request in another thread."""
        return self._threads.submit(function, *arguments)

    def map(self, function: Callable[[Argument], Result], arguments: Iterable[Argument]) -> list[Result]:
        """Call a function that makes a request with each argument, concurrently."""
        listed = list(arguments)
        return [function(listed[0])] if len(listed) == 1 else list(self._threads.map(function, listed))

    # --- listing ----------------------------------------------------------------------------------------

    def names(self, folder: str, suffix: str = "") -> list[str]:
        """Files directly in ``folder``, sorted; empty when the folder does not exist."""
        found, _ = self._store.list(folder)
        for each in found:
            self._note(each)
        return sorted(each.name for each in found if each.name.endswith(suffix))

    def folders(self, folder: str) -> list[str]:
        """Names of the folders directly in ``folder``, sorted."""
        return sorted(self._store.list(folder)[1])

    def listing(self, folder: str) -> list[Listed]:
        """Every file below a folder, at any depth, in any order."""
        return [Listed(each.name, each.size, each.modified) for each in self._store.walk(folder)]

    def size(self, name: str) -> int | None:
        """Bytes of a file; None when it does not exist."""
        found = self._store.find(name)
        if found is None:
            return None
        self._note(found)
        return found.size

    def _note(self, found: Stored) -> None:
        """Remember ETag and size of a file, which its cached copy must have."""
        self._marks[found.name], self._sizes[found.name] = found.mark, found.size

    def sizes(self, names: Sequence[str]) -> list[int | None]:
        """Call :meth:`size` for many files, concurrently."""
        return self.map(self.size, names)

    # --- reading ----------------------------------------------------------------------------------------

    def path(self, name: str) -> Path:
        """Path of a cached copy of a file, downloaded if necessary.

        Raises:
            FileGone: The file does not exist.
            LakeError: The store does not answer.
        """
        if not name.startswith(_BY_CONTENT) and name not in self._marks:
            self.size(name)
        copy = self._copies.find(name, self._mark(name), self._sizes.get(name))
        if copy is None:
            temporary = self.temporary()
            self._note(self._store.download(name, temporary))
            copy = self._copies.add(temporary, name, self._mark(name))
        return copy

    def paths(self, names: Sequence[str]) -> list[Path]:
        """Call :meth:`path` for many files, concurrently."""
        return self.map(self.path, names)

    def _mark(self, name: str) -> str:
        """The ETag that distinguishes versions of a file; "" when the name already contains a digest of the content."""
        return "" if name.startswith(_BY_CONTENT) else self._marks.get(name, "")

    def digest(self, name: str) -> str:
        """SHA-256 of a file in the store, hexadecimal; downloads it without caching."""
        checksum = hashlib.sha256()
        for piece in self._store.pieces(name):
            checksum.update(piece)
        return checksum.hexdigest()

    def verify(self, name: str) -> bool:
        """Verify a Parquet file by its seal; one of the large tables is downloaded without caching."""
        if not name.startswith(READ_IN_PLACE):
            return super().verify(name)
        temporary = self.temporary()
        self._store.download(name, temporary)
        try:
            return seals.verify_again(temporary, self.place(name), self.url(name))
        finally:
            temporary.unlink()

    def end(self, name: str) -> FileEnd:
        """The verified end of a Parquet file; of the large tables no more is downloaded."""
        return self.last(name)[2] if name.startswith(READ_IN_PLACE) else super().end(name)

    def verified(self, name: str) -> Path:
        """Path of a verified copy; one that is damaged is downloaded again."""
        try:
            return super().verified(name)
        except LakeError:
            if not self._copies.discard(name, self._mark(name)):
                raise
        return super().verified(name)

    def check_bytes(self, name: str) -> None:
        """Verify the footer of a file of the large tables, and every byte of the others."""
        if name.startswith(READ_IN_PLACE):
            self.end(name)
        else:
            self.verified(name)

    def last(self, name: str) -> tuple[int, bytes, FileEnd]:
        """Size and last bytes of a Parquet file of one of the large tables, with its verified footer."""
        size, end = self._last(name, FOOTER)
        while len(end) < (needed := min(seals.needed(end), size)):
            size, end = self._last(name, needed)
        try:
            found = seals.check_end(end, size, self.place(name), self.url(name))
            return size, end, found or seals.open_end(self.verified(name), self.place(name))
        except LakeError:  # not kept, so that a file that has been restored is read
            self._copies.discard(f"{name}.end", str(FOOTER))
            self._copies.discard(f"{name}.end", str(needed))
            raise

    def _last(self, name: str, length: int) -> tuple[int, bytes]:
        """Size and at most the last ``length`` bytes; cached with the size in front."""
        copy = self._copies.find(f"{name}.end", str(length))
        kept = copy.read_bytes() if copy else b""
        size = int.from_bytes(kept[:8], "little")
        if len(kept) == 8 + min(length, size):
            return size, kept[8:]
        size, end = self._store.last(name, length)
        temporary = self.temporary()
        with writing(temporary, temporary):
            temporary.write_bytes(size.to_bytes(8, "little") + end)
        self._copies.add(temporary, f"{name}.end", str(length))
        return size, end

    def range(self, name: str, start: int, end: int) -> memoryview:
        """Bytes ``start`` to ``end`` (exclusive) of a file."""
        return self._store.range(name, start, end)

    def read_all(self, names: Sequence[str], columns: list[str] | None = None) -> list[pa.Table]:
        """Rows of each of several Parquet files, downloaded concurrently."""
        self.paths(names)
        return super().read_all(names, columns)

    def scans(self, names: Sequence[str]) -> list[str]:
        """URLs of files of the large tables, paths of cached copies of the others."""
        small = [name for name in names if not name.startswith(READ_IN_PLACE)]
        copies = dict(zip(small, self.map(self.verified, small), strict=True))
        self.map(self.end, [name for name in names if name not in copies])
        return [str(copies[name]) if name in copies else self.url(name) for name in names]

    def filesystem(self) -> Any:
        """The lake as an fsspec file system."""
        from scenarionet_data.storage.files.fsspec_adapter import RemoteFilesystem  # lazy: fsspec is optional

        return RemoteFilesystem(self)

    # --- writing ----------------------------------------------------------------------------------------

    def publish(self, temporary: Path, name: str) -> None:
        """Upload a complete temporary file; it becomes visible atomically."""
        try:
            self._marks[name] = self._store.put(name, temporary)
        except BaseException:
            temporary.unlink(missing_ok=True)
            raise
        if name.startswith(READ_IN_PLACE):
            temporary.unlink()
        else:  # small files are soon read again: cache the upload
            self._sizes[name] = temporary.stat().st_size
            self._copies.add(temporary, name, self._mark(name))

    def publish_new(self, name: str, data: bytes | Path) -> bool:
        """Upload bytes or a temporary file unless a file of that name exists; see :class:`LakeFiles`."""
        is_created = self._store.create(name, data.read_bytes() if isinstance(data, Path) else data)
        self._marks.pop(name, None)
        if is_created and isinstance(data, Path):
            data.unlink()
        return is_created

    def publish_folder(self, temporary: Path, name: str) -> bool:
        """Upload the files of a temporary folder unless a folder of that name has files; see :class:`LakeFiles`."""
        is_free = not self.names(name)
        created = is_free and all(self.publish_new(f"{name}/{path.name}", path) for path in sorted(temporary.iterdir()))
        delete(temporary)
        return created

    def remove(self, name: str) -> None:
        """Remove a file or folder."""
        removed = [each.name for each in self._store.walk(name)] or [name]
        self._store.delete(removed)
        for each in removed:
            self._marks.pop(each, None)

    def renew(self, names: Iterable[str]) -> list[str]:
        """Upload files older than an hour again, from cached copies; returns those that no longer exist."""
        listed = list(names)
        exists = self.map(self._renewed, listed)
        return [name for name, still_exists in zip(listed, exists, strict=True) if not still_exists]

    def _renewed(self, name: str) -> bool:
        """Renew one file; returns whether it exists."""
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
