"""The interface to a lake's files, implemented by :mod:`.local` for folders and :mod:`.remote` for object stores.

Every file is written under a temporary name and published whole; a published file never changes. File names are
relative to the lake and use forward slashes.
"""

from __future__ import annotations

import hashlib
import os
import re
import shutil
import time
import uuid
from abc import ABC, abstractmethod
from collections import deque
from collections.abc import Iterable, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from dataclasses import dataclass
from functools import partial
from itertools import repeat
from pathlib import Path
from typing import Any

import pyarrow as pa
import pyarrow.parquet as pq

from scenarionet_data.errors import LakeError
from scenarionet_data.storage.files.errors import check_is_file, reading, writing
from scenarionet_data.storage.integrity import seals
from scenarionet_data.storage.integrity.file_end import FileEnd, Place

READ_IN_PLACE = ("tracks/", "lights/", "maps/")
"""Large tables, of which readers need a few row groups."""

IDENTITY = "lake.json"
"""File with the id of a lake, which is published before the first file that is bound to it."""

_BOUND = re.compile(r"databases/.*|layers/.*|results/.*|moments/.*|snapshots/[0-9]+\.json|origins\.json")
"""Files that no snapshot lists: a valid one of another lake could have the same name."""

_OF_RUN = re.compile(r"(results/[^/]+|moments/[^/]+/[^/]+/[^/]+)/[^/]+/.+")
"""Files of a run, or of a version of moments, besides its description: those of an earlier one of the same name could
take their place."""
_TEMPORARY = ".tmp"
_ABANDONED_AFTER = 24 * 3600.0

_ONE_THREAD = 2**18
"""Bytes of a file up to which starting threads takes longer than reading it."""

_FEW_BYTES = 2**26
"""Bytes of files up to which one thread verifies them: several wait for each other's turn in the interpreter."""


@dataclass(frozen=True)
class Listed:
    """A file in a listing.

    Attributes:
        name: Relative to the lake.
        size: Bytes.
        modified: Time of publication or of the last renewal [s since 1970].
    """

    name: str
    size: int
    modified: float


class LakeFiles(ABC):
    """Reads, publishes, lists and removes files below a lake's root; see :func:`.places.open_files`.

    Attributes:
        root: Absolute path of the lake, or its URL.
        scanned_folders: Folders that SQL may read, each with a trailing slash.
    """

    root: Path | str
    scanned_folders: Sequence[str]
    _folder: Path
    _identity: tuple[str, bool] | None = None

    # --- identity ---------------------------------------------------------------------------------------

    def place(self, name: str, runs: dict[str, str] | None = None) -> Place:
        """What the seal of a file covers besides its bytes.

        Args:
            name: The file.
            runs: Ids of runs that are known, by their folder; written, so that several files ask once.

        Raises:
            LakeError: The id of the lake, or of a run, is damaged.
        """
        if not _BOUND.fullmatch(name):
            return Place(name)
        if self._identity is None and self.size(IDENTITY) is not None:
            try:
                content, _ = seals.read_json(self.content(IDENTITY), Place(IDENTITY))
                self._identity = str(content["id"]), bool(content["has_older_files"])
            except (ValueError, KeyError, seals.NewerFormat) as error:
                remedy = "damaged, it holds no id of a lake; restore it from a copy of it"
                raise LakeError(f"{self.url(IDENTITY)}: {remedy}") from error
        lake, may_be_older = self._identity or ("", True)
        of_run, runs = _OF_RUN.fullmatch(name), {} if runs is None else runs
        if of_run and of_run[1] not in runs:
            runs[of_run[1]], description = "", f"{of_run[1]}/run.json"  # no id in a run of an older version
            try:
                if self.has(description):
                    content, _ = seals.read_json(self.content(description), self.place(description))
                    runs[of_run[1]] = str(content.get("id", ""))
            except (ValueError, seals.NewerFormat) as error:
                remedy = "damaged, it is no description of a run; restore it from a copy of it"
                raise LakeError(f"{self.url(description)}: {remedy}") from error
        run = runs[of_run[1]] if of_run else ""
        return Place(name, f"{lake}/{run}", may_be_older=False) if run else Place(name, lake, may_be_older)

    def place_to_write(self, name: str) -> Place:
        """The same for a file that is about to be written; a lake without an id gets one."""
        if self._identity is None and _BOUND.fullmatch(name) and not self.has(IDENTITY):
            content = {"id": uuid.uuid4().hex, "has_older_files": bool(self.names("snapshots", ".json"))}
            self.publish_new(IDENTITY, seals.seal_json(content, Place(IDENTITY)))
        return self.place(name)

    # --- listing ----------------------------------------------------------------------------------------

    @abstractmethod
    def names(self, folder: str, suffix: str = "") -> list[str]:
        """Files directly in ``folder``, sorted; empty when the folder does not exist."""

    def numbers(self, folder: str, suffix: str = ".parquet") -> list[int]:
        """Numbers of the files directly in a folder that are named by a number, ascending."""
        found = []
        for name in self.names(folder, suffix):
            stem = name.rpartition("/")[2].removesuffix(suffix)
            if stem.isdecimal():
                found.append(int(stem))
        return sorted(found)

    @abstractmethod
    def folders(self, folder: str) -> list[str]:
        """Names of the folders directly in ``folder``, sorted."""

    @abstractmethod
    def listing(self, folder: str) -> list[Listed]:
        """Every file below a folder, at any depth, in any order."""

    def strange(self) -> dict[str, str]:
        """What is neither a file nor a folder, by name, with what it is: pipes, links to nothing or in a circle."""
        return {}

    @abstractmethod
    def size(self, name: str) -> int | None:
        """Bytes of a file; None when it does not exist."""

    def sizes(self, names: Sequence[str]) -> list[int | None]:
        """Call :meth:`size` for many files."""
        return [self.size(name) for name in names]

    def has(self, name: str, size: int | None = None) -> bool:
        """Whether a file exists (and has this size)."""
        found = self.size(name)
        return found is not None and size in (None, found)

    def url(self, name: str) -> str:
        """Absolute path or URL of a file, for messages and other programs."""
        return f"{self.root}/{name}"

    # --- reading ----------------------------------------------------------------------------------------

    def path(self, name: str) -> Path:
        """Local path of a file: the lake's own file, or a copy of it."""
        return self._folder / name

    def content(self, name: str) -> bytes:
        """Bytes of a small file.

        Raises:
            LakeError: It is missing, or no file.
        """
        path = self.path(name)
        check_is_file(path)
        with reading(path):
            return path.read_bytes()

    def paths(self, names: Sequence[str]) -> list[Path]:
        """Call :meth:`path` for many files."""
        return list(map(self.path, names))

    @abstractmethod
    def digest(self, name: str) -> str:
        """SHA-256 of a file, hexadecimal."""

    def verify(self, name: str) -> bool:
        """Verify every byte of a Parquet file, also if it was verified before; returns whether that was possible.

        Raises:
            LakeError: It is missing or damaged, or not the file that was published under this name.
        """
        return seals.verify_again(self.path(name), self.place(name))

    def verified(self, name: str) -> Path:
        """Local path of a file of which every byte that can be is verified, once a process.

        Raises:
            LakeError: It is missing or damaged.
        """
        path = self.path(name)
        seals.verify(path, self.place(name))
        return path

    def are_verified(self, names: Iterable[str]) -> bool:
        """Whether every byte of some small files is verified; False for some files of older versions.

        Raises:
            LakeError: A file is missing or damaged.
        """
        listed = list(names)
        return all([*map(seals.verify, self.paths(listed), map(partial(self.place, runs={}), listed))])

    def check_bytes(self, name: str) -> None:
        """Verify as much of a file as can be without downloading a large one: every byte, once a process.

        Raises:
            LakeError: It is missing or damaged.
        """
        self.verified(name)

    def end(self, name: str) -> FileEnd:
        """The verified end of a Parquet file, with its footer.

        Raises:
            LakeError: It is missing or damaged.
        """
        return seals.open_end(self.path(name), self.place(name))

    def footer(self, name: str) -> pq.FileMetaData:
        """Footer of a Parquet file, verified.

        Raises:
            LakeError: The file is missing or damaged.
        """
        return seals.parsed(self.end(name), self.url(name))

    def read(self, name: str, columns: list[str] | None = None, group: int | None = None) -> pa.Table:
        """Rows of a Parquet file, or of one of its row groups, of which the whole file is verified."""
        path = self.path(name)
        is_whole = seals.verify(path, self.place(name))
        with reading(path):
            file, use_threads = pq.ParquetFile(path), path.stat().st_size > _ONE_THREAD
            rows = (
                file.read(columns, use_threads=use_threads)
                if group is None
                else file.read_row_group(group, columns, use_threads=use_threads)
            )
            if not is_whole:
                rows.validate(full=True)  # texts may be damaged
        return rows

    def read_all(self, names: Sequence[str], columns: list[str] | None = None) -> list[pa.Table]:
        """Rows of each of several Parquet files."""
        return list(map(self.read, names, repeat(columns)))

    def scans(self, names: Sequence[str]) -> list[str]:
        """Paths or URLs under which SQL scans files; all are below :attr:`scanned_folders`.

        Every byte is verified, once a process.

        Raises:
            LakeError: A file is missing or damaged.
        """
        paths = list(map(self.path, names))
        places = map(partial(self.place, runs={}), names)
        if sum(filter(None, map(self.size, names))) < _FEW_BYTES:
            deque(map(seals.verify, paths, places), maxlen=0)
        else:
            with ThreadPoolExecutor() as pool:
                deque(pool.map(seals.verify, paths, places), maxlen=0)
        return list(map(str, paths))

    def filesystem(self) -> Any:
        """The fsspec file system for the URLs of :meth:`scans`; None when they are paths."""
        return None

    # --- writing ----------------------------------------------------------------------------------------

    def temporary(self) -> Path:
        """A new path to write to before :meth:`publish`, unique among all processes."""
        folder = self._folder / _TEMPORARY
        with writing(folder):
            make_folder(folder)
        return folder / f"{os.getpid()}-{uuid.uuid4().hex}"

    @abstractmethod
    def publish(self, temporary: Path, name: str) -> None:
        """Give a complete temporary file its name, atomically and durably."""

    @abstractmethod
    def publish_new(self, name: str, data: bytes | Path) -> bool:
        """Publish ``data`` (bytes, or a temporary file) unless a file of that name exists.

        A temporary file that is not published is kept, so that it can be published under another name.

        Returns:
            Whether this call created the file; exactly one of several concurrent callers does.
        """

    @abstractmethod
    def publish_folder(self, temporary: Path, name: str) -> bool:
        """Publish the files of a temporary folder unless a folder of that name has files.

        Returns:
            Whether this call created the folder. The temporary folder is gone in any case.
        """

    @abstractmethod
    def remove(self, name: str) -> None:
        """Remove a file or folder."""

    @abstractmethod
    def remove_unchanged(self, listed: Listed) -> bool:
        """Remove a file unless it has been published or renewed since it was listed; returns whether it did."""

    @abstractmethod
    def renew(self, names: Iterable[str]) -> list[str]:
        """Set the modification time of published files to now, which protects them from ``vacuum``.

        Returns:
            Those that no longer exist.
        """

    def sweep(self) -> None:
        """Remove temporary files that a killed job left more than a day ago."""
        for path in (self._folder / _TEMPORARY).glob("*"):
            with suppress(FileNotFoundError):  # another job has removed or published it
                if time.time() - path.stat().st_mtime > _ABANDONED_AFTER:
                    delete(path)


def delete(path: Path) -> None:
    """Remove a file or folder."""
    if path.is_dir():
        shutil.rmtree(path)
    else:
        path.unlink()


def flush(path: Path) -> None:
    """Flush the bytes of a file, or the names in a folder: a renamed or linked file survives a power failure then."""
    descriptor = os.open(path, os.O_RDONLY)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)


def make_folder(path: Path) -> None:
    """Create a folder, and those above it, and flush their names; an existing one is left as it is."""
    if not path.is_dir():
        make_folder(path.parent)
        path.mkdir(exist_ok=True)
        flush(path.parent)


def sha256(path: Path) -> str:
    """SHA-256 of a local file, hexadecimal."""
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()
