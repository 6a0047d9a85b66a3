"""Read-only fsspec file system over a remote lake, through which DuckDB reads Parquet files."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from datetime import UTC, datetime
from typing import Any, Protocol

from fsspec import AbstractFileSystem
from fsspec.spec import AbstractBufferedFile

from scenarionet_data.errors import LakeError
from scenarionet_data.storage.integrity.file_end import FileEnd

_READ_AHEAD = 2**20
"""Read-ahead [bytes]: DuckDB requests the adjacent columns of a row group one after the other."""


class RangeFiles(Protocol):
    """Files that are read by byte range."""

    @property
    def root(self) -> object:
        """URL of the lake."""

    def last(self, name: str) -> tuple[int, bytes, FileEnd]:
        """Size and last bytes of a Parquet file, with its verified footer."""

    def range(self, name: str, start: int, end: int) -> memoryview:
        """Bytes ``start`` to ``end`` (exclusive) of a file."""


class RemoteFilesystem(AbstractFileSystem):  # type: ignore[misc]  # fsspec has no types
    """The files below a lake's URL.

    Args:
        files: The lake.
    """

    cachable = False

    def __init__(self, files: RangeFiles) -> None:
        super().__init__()
        self._files = files
        self._failure: LakeError | None = None
        self.protocol = str(files.root).partition("://")[0]

    @classmethod
    def _strip_protocol(cls, path: str) -> str:
        """Keep URLs unchanged."""
        return str(path)

    def info(self, path: str, **_: Any) -> dict[str, Any]:
        """Name, size and type of a file."""
        size, _end = self._end(path)
        return {"name": path, "size": size, "type": "file"}

    def glob(self, path: str, **_: Any) -> list[str]:
        """The path itself: snapshots list files by name, never by pattern."""
        return [path]

    def modified(self, path: str) -> datetime:  # noqa: ARG002
        """A constant: published files never change."""
        return datetime.fromtimestamp(0, UTC)

    def _open(self, path: str, mode: str = "rb", **_: Any) -> RemoteFile:
        if mode != "rb":
            raise PermissionError(f"{path}: SQL can only read")
        return RemoteFile(self, path, mode, _READ_AHEAD, cache_type="readahead")

    def _name(self, path: str) -> str:
        return path.removeprefix(f"{self._files.root}/")

    def range(self, path: str, start: int, end: int) -> bytes:
        """Bytes ``start`` to ``end`` (exclusive) of a file; the end of the file with its footer is cached."""
        size, last = self._end(path)
        first = size - len(last)
        if start >= first:
            return last[start - first : end - first]
        with self._noting_failure():
            return bytes(self._files.range(self._name(path), start, end))

    def pop_failure(self) -> LakeError | None:
        """The error of the last failed request, if any; DuckDB only reports a traceback."""
        failure, self._failure = self._failure, None
        return failure

    def _end(self, path: str) -> tuple[int, bytes]:
        with self._noting_failure():
            size, end, _ = self._files.last(self._name(path))
            return size, end

    @contextmanager
    def _noting_failure(self) -> Iterator[None]:
        try:
            yield
        except LakeError as error:
            self._failure = LakeError(*error.args)
            raise


class RemoteFile(AbstractBufferedFile):  # type: ignore[misc]
    """An open file."""

    def _fetch_range(self, start: int, end: int) -> bytes:
        found: bytes = self.fs.range(self.path, start, end)
        return found
