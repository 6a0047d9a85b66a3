"""The files of a lake: the only module that writes, renames and lists them, with ``remote_files`` for object stores.

Every file is written under a temporary name and published whole; a published file never changes. Names are
relative to the lake and use forward slashes.
"""

from __future__ import annotations

import errno
import hashlib
import os
import shutil
import time
import uuid
from collections.abc import Iterable, Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from urllib.parse import unquote, urlsplit

import pyarrow as pa
import pyarrow.parquet as pq

from scenarionet_data.errors import LakeError
from scenarionet_data.storage.files.errors import reading, writing

_TEMPORARY = ".tmp"
_ABANDONED_AFTER = 24 * 3600.0


@dataclass(frozen=True)
class Listed:
    """A file of a lake.

    Attributes:
        name: Relative to the lake.
        size: Bytes.
        modified: When it was published or renewed [s since 1970].
    """

    name: str
    size: int
    modified: float


def open_files(root: str | Path) -> LakeFiles:
    """The files of a lake by its folder or URL: ``lake``, ``file:///data/lake``, ``s3://bucket/lake``, ``gs://...``.

    Raises:
        LakeError: The URL is of a kind that is not known.
        MissingDependency: What object stores need is not installed.
    """
    if not is_url(root):
        return LakeFiles(root)
    parts = urlsplit(str(root))
    if parts.scheme == "file" and parts.netloc in ("", "localhost"):
        return LakeFiles(unquote(parts.path))
    from scenarionet_data.storage.files.remote import RemoteLakeFiles  # here: a lake in a folder needs none of it

    return RemoteLakeFiles(str(root))


def is_url(place: str | Path) -> bool:
    """Whether a place is given as a URL, not as a path."""
    return isinstance(place, str) and "://" in place


class LakeFiles:
    """Files below a lake's root folder; :func:`open_files` opens a folder or an object store alike.

    Attributes:
        root: Absolute path of the lake, or its URL.
    """

    root: Path | str

    def __init__(self, root: str | Path) -> None:
        self.root = self._folder = Path(root).resolve()

    def path(self, name: str) -> Path:
        """A file on this machine: the lake's own, or a copy of it."""
        return self._folder / name

    def paths(self, names: Sequence[str]) -> list[Path]:
        """Like :meth:`path`, of many at once."""
        return [self.path(name) for name in names]

    def url(self, name: str) -> str:
        """Where a file lies, for other programs: an absolute path, or a URL."""
        return f"{self.root}/{name}"

    def scans(self, names: Sequence[str]) -> list[str]:
        """Paths or URLs under which SQL scans files; all lie below :attr:`scanned_folders`."""
        return [str(path) for path in self.paths(names)]

    @property
    def scanned_folders(self) -> list[str]:
        """Folders, each with a slash at the end, below which everything lies that SQL may read."""
        return [f"{self._folder}/"]

    def filesystem(self) -> Any:
        """What DuckDB reads the URLs of :meth:`scans` with, an fsspec file system; None when they are paths."""
        return None

    def names(self, folder: str, suffix: str = "") -> list[str]:
        """Files directly in ``folder``, sorted; empty when there is no such folder."""
        found = [entry.name for entry in self._entries(folder) if entry.is_file()]
        return sorted(f"{folder}/{name}" for name in found if name.endswith(suffix))

    def folders(self, folder: str) -> list[str]:
        """Names of the folders directly in ``folder``, sorted."""
        return sorted(entry.name for entry in self._entries(folder) if entry.is_dir())

    def _entries(self, folder: str) -> list[os.DirEntry[str]]:
        path = self._folder / folder
        with reading(path):
            try:
                return list(os.scandir(path))
            except (FileNotFoundError, NotADirectoryError):
                return []

    def has(self, name: str, size: int | None = None) -> bool:
        """Whether a file is there (with that size)."""
        found = self.size(name)
        return found is not None and size in (None, found)

    def size(self, name: str) -> int | None:
        """Bytes of a file; None when it is not there."""
        try:
            return self.path(name).stat().st_size
        except OSError:
            return None

    def sizes(self, names: Sequence[str]) -> list[int | None]:
        """Like :meth:`size`, of many at once."""
        return [self.size(name) for name in names]

    def read(self, name: str, columns: list[str] | None = None) -> pa.Table:
        """Rows of a Parquet file."""
        return self.read_all([name], columns)[0]

    def read_all(self, names: Sequence[str], columns: list[str] | None = None) -> list[pa.Table]:
        """Rows of Parquet files, of each."""
        return [_read(path, columns) for path in self.paths(names)]

    def footer(self, name: str) -> pq.FileMetaData:
        """Footer of a Parquet file."""
        path = self.path(name)
        with reading(path):
            return pq.read_metadata(path)

    def digest(self, name: str) -> str:
        """SHA-256 of a file, hexadecimal."""
        path = self.path(name)
        with reading(path):
            return sha256(path)

    def temporary(self) -> Path:
        """A new path to write to before :meth:`publish`."""
        folder = self._folder / _TEMPORARY
        with writing(folder):
            folder.mkdir(parents=True, exist_ok=True)
        return folder / f"{os.getpid()}-{uuid.uuid4().hex}"

    def publish(self, temporary: Path, name: str) -> None:
        """Give a complete temporary file its name, at once and for good."""
        target = self.path(name)
        with writing(target, temporary):
            target.parent.mkdir(parents=True, exist_ok=True)
            _to_disk(temporary)
            temporary.replace(target)

    def publish_new(self, name: str, data: bytes | Path) -> bool:
        """Publish ``data`` (bytes, or a temporary file) unless a file of that name exists.

        A temporary file that is not published stays: it may get another name.

        Returns:
            Whether this call made the file; exactly one of several concurrent callers does.
        """
        temporary = data if isinstance(data, Path) else self.temporary()
        target = self.path(name)
        with writing(target, temporary):
            if isinstance(data, bytes):
                temporary.write_bytes(data)
            _to_disk(temporary)
            target.parent.mkdir(parents=True, exist_ok=True)
            try:
                os.link(temporary, target)
            except FileExistsError:
                if isinstance(data, bytes):
                    temporary.unlink()
                return False
            temporary.unlink()
        return True

    def move(self, folder: str, name: str) -> bool:
        """Give a folder another name, at once; returns whether that name was free."""
        target = self.path(name)
        with writing(target):
            try:
                self.path(folder).rename(target)
            except OSError as error:
                if error.errno not in (errno.ENOTEMPTY, errno.EEXIST):
                    raise
                return False
        return True

    def remove(self, name: str) -> None:
        """Remove a file or folder: nobody sees half of it."""
        gone = self.temporary()
        with writing(self.path(name)):
            self.path(name).rename(gone)
            with suppress(FileNotFoundError):  # swept by another job, as it is old
                _delete(gone)

    def listing(self, folder: str) -> list[Listed]:
        """Every file below a folder, at any depth, in any order."""
        found = []
        for entry in self._entries(folder):
            name = f"{folder}/{entry.name}"
            if entry.is_dir(follow_symlinks=False):
                found += self.listing(name)
                continue
            with suppress(FileNotFoundError):  # it has been removed since
                state = entry.stat()
                found.append(Listed(name, state.st_size, state.st_mtime))
        return found

    def renew(self, names: Iterable[str]) -> list[str]:
        """Make published files as young as if they were published now, so that no ``vacuum`` takes them.

        Returns:
            Those that are gone.
        """
        gone = []
        for name in names:
            path = self.path(name)
            try:
                with writing(path):
                    os.utime(path)
            except LakeError as error:
                if not isinstance(error.__cause__, FileNotFoundError):
                    raise
                gone.append(name)
        return gone

    def remove_unchanged(self, listed: Listed) -> bool:
        """Remove a file unless it has been published or renewed since it was listed; returns whether it did."""
        path, gone = self.path(listed.name), self.temporary()
        with writing(path):
            try:
                path.rename(gone)  # first, so that from here on nobody can renew it
            except FileNotFoundError:
                return False
            with suppress(FileNotFoundError):  # swept by another job, as it is old
                if gone.stat().st_mtime != listed.modified:
                    gone.rename(path)
                    return False
                gone.unlink()
        return True

    def sweep(self) -> None:
        """Remove what a killed job left below the temporary folder more than a day ago."""
        for entry in self._entries(_TEMPORARY):
            with suppress(FileNotFoundError):  # its owner was alive after all
                if time.time() - entry.stat().st_mtime > _ABANDONED_AFTER:
                    _delete(Path(entry.path))


def _read(path: Path, columns: list[str] | None) -> pa.Table:
    with reading(path):
        return pq.ParquetFile(path).read(columns)


def _delete(path: Path) -> None:
    """Remove a file or folder."""
    if path.is_dir():
        shutil.rmtree(path)
    else:
        path.unlink()


def sha256(path: Path) -> str:
    """SHA-256 of a file, hexadecimal."""
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def _to_disk(path: Path) -> None:
    with path.open("rb+") as file:
        os.fsync(file.fileno())
