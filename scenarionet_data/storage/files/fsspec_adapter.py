"""A lake's files in an object store as DuckDB reads them: by fsspec's protocol, and for reading alone."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from datetime import UTC, datetime
from typing import Any

from fsspec import AbstractFileSystem
from fsspec.spec import AbstractBufferedFile

from scenarionet_data.errors import LakeError
from scenarionet_data.storage.files.remote import RemoteLakeFiles

_READ_AHEAD = 2**20
"""Bytes read at once: DuckDB asks for one column of one row group after the other, and they lie side by side."""


class RemoteFilesystem(AbstractFileSystem):  # type: ignore[misc]  # fsspec has no types
    """The files below a lake's URL.

    Args:
        files: The lake.
    """

    cachable = False

    def __init__(self, files: RemoteLakeFiles) -> None:
        super().__init__()
        self._files = files
        self._failure: LakeError | None = None
        self.protocol = str(files.root).partition("://")[0]

    @classmethod
    def _strip_protocol(cls, path: str) -> str:
        """URLs stay URLs."""
        return str(path)

    def info(self, path: str, **_: Any) -> dict[str, Any]:
        """Name, size and type of a file."""
        size, _end = self._end(path)
        return {"name": path, "size": size, "type": "file"}

    def glob(self, path: str, **_: Any) -> list[str]:
        """The file itself: a snapshot lists every file by its name."""
        return [path]

    def modified(self, path: str) -> datetime:  # noqa: ARG002
        """Always the same: published files never change."""
        return datetime.fromtimestamp(0, UTC)

    def _open(self, path: str, mode: str = "rb", **_: Any) -> RemoteFile:
        if mode != "rb":
            raise PermissionError(f"{path}: SQL only reads")
        return RemoteFile(self, path, mode, _READ_AHEAD, cache_type="readahead")

    def _name(self, path: str) -> str:
        return path.removeprefix(f"{self._files.root}/")

    def range(self, path: str, start: int, end: int) -> bytes:
        """Bytes of a file; footers are read again and again, and fetched once."""
        size, last = self._end(path)
        first = size - len(last)
        if start >= first:
            return last[start - first : end - first]
        with self._noting_failure():
            return bytes(self._files.range(self._name(path), start, end))

    def pop_failure(self) -> LakeError | None:
        """Why the store did not give what DuckDB asked for last; DuckDB itself tells it as a traceback."""
        failure, self._failure = self._failure, None
        return failure

    def _end(self, path: str) -> tuple[int, bytes]:
        with self._noting_failure():
            return self._files.end(self._name(path))

    @contextmanager
    def _noting_failure(self) -> Iterator[None]:
        try:
            yield
        except LakeError as error:
            self._failure = LakeError(*error.args)
            raise


class RemoteFile(AbstractBufferedFile):  # type: ignore[misc]
    """One of them, open."""

    def _fetch_range(self, start: int, end: int) -> bytes:
        found: bytes = self.fs.range(self.path, start, end)
        return found
