"""The files of a lake in an object store (S3, Google Cloud Storage).

There is no rename there: a file is uploaded under its final name and is nowhere until it is whole, and a snapshot, a
database or a layer is put on the condition that none of that name exists. Published files never change, so whoever
needs a whole file works on a copy on this machine; the big tables are read in place, by byte ranges.
"""

from __future__ import annotations

import hashlib
import uuid
from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import contextmanager
from functools import cached_property
from pathlib import Path
from typing import Any, TypeVar

import pyarrow as pa
import pyarrow.parquet as pq

from scenarionet_data.errors import LakeError
from scenarionet_data.store import object_store
from scenarionet_data.store.files import LakeFiles, open_files, reading, writing
from scenarionet_data.store.local_copies import LocalCopies, folder_of
from scenarionet_data.store.object_store import asking

_AT_ONCE = 32
"""Requests in flight."""

FOOTER = 2**17
"""Bytes asked of the end of a file to have its footer: those of 64 row groups are 60-100 kB."""

_BY_CONTENT = ("tracks/", "lights/", "maps/", "quarantine/")
"""Their files' names end in a digest of the content; others may be dropped, and made again under the same name."""

_READ_IN_PLACE = ("tracks/", "lights/", "maps/")
_ATTRIBUTE = "publisher"

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
        self._store = object_store.open_store(self._url)
        self._folder = folder_of(f"{object_store.endpoint()} {self._url}")
        self._copies = LocalCopies(self._folder)
        self._marks: dict[str, str] = {}

    def __reduce__(self) -> tuple[Any, ...]:
        return open_files, (self._url,)

    # --- reading ------------------------------------------------------------------------------------

    def path(self, name: str) -> Path:
        """A copy of a file on this machine.

        Raises:
            LakeError: It is not there, or the store does not answer.
        """
        copy = self._copies.find(name, self._mark(name))
        return copy or self._download(name)

    def paths(self, names: Sequence[str]) -> list[Path]:
        """Copies of many files, fetched side by side."""
        return self.side_by_side(self.path, names)

    def url(self, name: str) -> str:
        """Its URL."""
        return f"{self._url}/{name}"

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
        from scenarionet_data.store.remote_filesystem import RemoteFilesystem  # here: fsspec is of the extra, too

        return RemoteFilesystem(self)

    def names(self, folder: str, suffix: str = "") -> list[str]:
        """Files directly in ``folder``, sorted; empty when there is no such folder."""
        listed = self._list(folder)["objects"]
        self._marks |= {each["path"]: str(each["e_tag"]) for each in listed}
        return sorted(each["path"] for each in listed if each["path"].endswith(suffix))

    def folders(self, folder: str) -> list[str]:
        """Names of the folders directly in ``folder``, sorted."""
        return sorted(each.rstrip("/").rpartition("/")[2] for each in self._list(folder)["common_prefixes"])

    def size(self, name: str) -> int | None:
        """Bytes of a file; None when it is not there."""
        import obstore

        try:
            with asking(self.url(name)):
                found = obstore.head(self._store, name)
        except FileNotFoundError:
            return None
        self._marks[name] = str(found["e_tag"])
        return int(found["size"])

    def sizes(self, names: Sequence[str]) -> list[int | None]:
        """Like :meth:`size`, asked side by side."""
        return self.side_by_side(self.size, names)

    def digest(self, name: str) -> str:
        """SHA-256 of a file as it is in the store, hexadecimal; it is not kept."""
        import obstore

        found = hashlib.sha256()
        with self._reading(name):
            for piece in obstore.get(self._store, name).stream():
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
        import obstore

        copy = self._copies.find(f"{name}.end", str(length))
        if copy is None:
            with self._reading(name):
                got = obstore.get(self._store, name, options={"range": {"suffix": length}})
                content = int(got.meta["size"]).to_bytes(8, "little") + bytes(got.bytes())
            temporary = self.temporary()
            with writing(temporary, temporary):
                temporary.write_bytes(content)
            copy = self._copies.add(temporary, f"{name}.end", str(length))
        kept = copy.read_bytes()
        return int.from_bytes(kept[:8], "little"), kept[8:]

    def range(self, name: str, start: int, end: int) -> bytes:
        """Bytes ``start`` to ``end`` (exclusive) of a file."""
        import obstore

        with self._reading(name):
            return bytes(obstore.get_range(self._store, name, start=start, end=end))

    def start(self, do: Callable[..., Made], *given: Any) -> Future[Made]:
        """Do something in another thread; for requests, which mostly wait."""
        return self._threads.submit(do, *given)

    def side_by_side(self, do: Callable[[Given], Made], given: Iterable[Given]) -> list[Made]:
        """What ``do`` makes of each, many at once."""
        listed = list(given)
        return [do(listed[0])] if len(listed) == 1 else list(self._threads.map(do, listed))

    @cached_property
    def _threads(self) -> ThreadPoolExecutor:
        return ThreadPoolExecutor(_AT_ONCE, "scenarionet-requests")

    def _list(self, folder: str) -> dict[str, Any]:
        import obstore

        with asking(self.url(folder)):
            found: Any = obstore.list_with_delimiter(self._store, None if folder == "." else folder)
        return dict(found)

    def _mark(self, name: str) -> str:
        """What tells a file's content from that of another of the same name; "" when the name does."""
        if name.startswith(_BY_CONTENT):
            return ""
        if name not in self._marks and self.size(name) is None:
            raise self._gone(name)
        return self._marks[name]

    def _download(self, name: str) -> Path:
        import obstore

        temporary = self.temporary()
        with self._reading(name):
            got = obstore.get(self._store, name)
            with writing(temporary, temporary):
                object_store.save(got, temporary)
        mark = "" if name.startswith(_BY_CONTENT) else str(got.meta["e_tag"])
        return self._copies.add(temporary, name, mark)

    @contextmanager
    def _reading(self, name: str) -> Iterator[None]:
        try:
            with asking(self.url(name)):
                yield
        except FileNotFoundError as error:
            raise self._gone(name) from error

    def _gone(self, name: str) -> LakeError:
        return LakeError(
            f"{self.url(name)}: gone; `scenarionet check` names every scenario that is hit: restore the file from a "
            "copy of the lake, or convert its recordings again"
        )

    # --- writing ------------------------------------------------------------------------------------

    def publish(self, temporary: Path, name: str) -> None:
        """Upload a complete temporary file: at once and for good."""
        import obstore

        try:
            with asking(self.url(name)):
                result = obstore.put(self._store, name, temporary)
        except BaseException as error:
            temporary.unlink(missing_ok=True)
            if isinstance(error, FileNotFoundError):
                raise object_store.no_bucket(self.url(name)) from error
            raise
        self._keep(temporary, name, str(result["e_tag"]))

    def publish_new(self, name: str, data: bytes | Path) -> bool:
        """Upload ``data`` (bytes, or a temporary file) unless a file of that name exists.

        Returns:
            Whether this call made the file; exactly one of several concurrent callers does.
        """
        import obstore

        content = data.read_bytes() if isinstance(data, Path) else data
        publisher = uuid.uuid4().hex
        try:
            with asking(self.url(name)):
                obstore.put(self._store, name, content, mode="create", attributes={_ATTRIBUTE: publisher})
        except obstore.exceptions.AlreadyExistsError:
            # Ours, when the answer to a first attempt was lost and the store was asked again.
            return self._publisher(name) == publisher
        except FileNotFoundError as error:
            raise object_store.no_bucket(self.url(name)) from error
        finally:
            if isinstance(data, Path):
                data.unlink()
        self._marks.pop(name, None)
        return True

    def move(self, folder: str, name: str) -> bool:
        """Give a folder another name, file by file, the old one last; returns whether that name was free."""
        import obstore

        listed = self.names(folder)
        if self.names(name):
            return False
        for old in listed:
            if not self.publish_new(f"{name}/{old.rpartition('/')[2]}", self.path(old).read_bytes()):
                return False
        with asking(self.url(folder)):
            obstore.delete(self._store, listed)
        return True

    def remove(self, name: str) -> None:
        """Remove a file or folder."""
        import obstore

        with asking(self.url(name)):
            below = [each["path"] for each in obstore.list(self._store, name).collect()]
            obstore.delete(self._store, below or name)
        self._marks = {known: mark for known, mark in self._marks.items() if known not in {name, *below}}

    def _publisher(self, name: str) -> str | None:
        import obstore

        with self._reading(name):
            return obstore.get(self._store, name, options={"head": True}).attributes.get(_ATTRIBUTE)

    def _keep(self, temporary: Path, name: str, mark: str) -> None:
        """Small files are soon read again: what was uploaded becomes the copy."""
        self._marks[name] = mark
        if name.startswith(_READ_IN_PLACE):
            temporary.unlink()
        else:
            self._copies.add(temporary, name, self._mark(name))
