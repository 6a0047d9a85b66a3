"""An object store, accessed through obstore: opened by URL, with retries and error messages that name the remedy.

Credentials, region and endpoint come from the usual environment variables
(``AWS_ACCESS_KEY_ID``, ``AWS_ENDPOINT_URL``, ``GOOGLE_APPLICATION_CREDENTIALS``, ...).
"""

from __future__ import annotations

import os
import re
import uuid
from collections.abc import Collection, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from datetime import timedelta
from pathlib import Path
from typing import Any

from scenarionet_data.errors import FileGone, LakeError, MissingDependency
from scenarionet_data.storage.files.errors import writing

SCHEMES = ("s3", "gs")
_ENDPOINTS = ("AWS_ENDPOINT_URL_S3", "AWS_ENDPOINT_URL", "AWS_ENDPOINT")
_PUBLISHER = "publisher"
_PAGE = 1000
"""Files in one page of a listing."""

_first_used_by: int | None = None


@dataclass(frozen=True)
class Stored:
    """A file in an object store.

    Attributes:
        name: Below the store's URL.
        size: Bytes.
        mark: ETag; changes with the content.
        modified: Time of the upload [s since 1970, on the store's clock].
    """

    name: str
    size: int
    mark: str
    modified: float


class ObjectStore:
    """Everything below a URL.

    Args:
        url: For example ``s3://bucket/lake``.

    Raises:
        LakeError: The URL scheme is not supported, or the environment's settings are invalid.
        MissingDependency: obstore is not installed.
    """

    def __init__(self, url: str) -> None:
        self.url = url
        try:
            import obstore
        except ImportError as error:
            raise MissingDependency(f"{url} needs obstore", "remote") from error
        scheme, _, place = url.partition("://")
        if scheme not in SCHEMES or not place.strip("/"):
            raise LakeError(f"{url}: wanted a folder, s3://BUCKET/PREFIX, gs://BUCKET/PREFIX or file:///FOLDER")
        _refuse_after_fork(url)
        self._obstore: Any = obstore
        try:
            self._store: Any = obstore.store.from_url(url, **_options(scheme))
        except (obstore.exceptions.BaseError, ValueError) as error:
            raise LakeError(f"{url}: {_first_line(error)}; `scenarionet doctor {url}` lists the settings") from error

    # --- listing ----------------------------------------------------------------------------------------

    def list(self, folder: str) -> tuple[list[Stored], list[str]]:
        """Files directly in a folder, and the names of the folders in it."""
        with self._translated_errors(folder):
            found = self._obstore.list_with_delimiter(self._store, None if folder == "." else folder)
        return [_stored(each) for each in found["objects"]], [
            each.rstrip("/").rpartition("/")[2] for each in found["common_prefixes"]
        ]

    def walk(self, folder: str | None = None, ignored: Collection[str] = ()) -> Iterator[Stored]:
        """Every file below a folder, at any depth, except in folders with one of the ignored names.

        An ignored folder may hold millions of files: when a page ends in one, the next request starts after it. Stores
        list in name order, and ``0`` is the character after ``/``.
        """
        behind: str | None = None
        with self._translated_errors(folder or ""):
            pages = self._pages(folder, behind)
            while page := next(pages, None):
                yield from (_stored(each) for each in page if not _folder_of(each["path"], ignored))
                behind = _folder_of(page[-1]["path"], ignored)
                if behind:
                    pages = self._pages(folder, f"{behind}0")

    def _pages(self, folder: str | None, behind: str | None) -> Iterator[Any]:
        return iter(self._obstore.list(self._store, folder, offset=behind, chunk_size=_PAGE))

    def find(self, name: str) -> Stored | None:
        """A file; None when it does not exist."""
        try:
            with self._translated_errors(name):
                return _stored(self._obstore.head(self._store, name))
        except FileNotFoundError:
            return None

    # --- reading; a missing file raises FileGone --------------------------------------------------------

    def download(self, name: str, path: Path) -> Stored:
        """Download a file to a local path."""
        with self._reading(name):
            got = self._obstore.get(self._store, name)
            with writing(path, path), path.open("wb") as file:
                for piece in got.stream():
                    file.write(piece)
        return _stored(got.meta)

    def pieces(self, name: str) -> Iterator[bytes]:
        """Stream a file's bytes."""
        with self._reading(name):
            yield from self._obstore.get(self._store, name).stream()

    def range(self, name: str, start: int, end: int) -> memoryview:
        """Bytes ``start`` to ``end`` (exclusive) of a file, without a copy (megabytes take milliseconds)."""
        with self._reading(name):
            return memoryview(self._obstore.get_range(self._store, name, start=start, end=end))

    def last(self, name: str, length: int) -> tuple[int, bytes]:
        """Size of a file, and at most its last ``length`` bytes."""
        with self._reading(name):
            got = self._obstore.get(self._store, name, options={"range": {"suffix": length}})
            return int(got.meta["size"]), bytes(got.bytes())

    # --- writing ----------------------------------------------------------------------------------------

    def put(self, name: str, content: Path | bytes) -> str:
        """Upload a file, replacing one of the same name; returns its ETag."""
        with self._translated_errors(name, is_written=True):
            return str(self._obstore.put(self._store, name, content)["e_tag"])

    def create(self, name: str, content: bytes) -> bool:
        """Upload a file unless one of that name exists; returns whether this call created it."""
        publisher = uuid.uuid4().hex
        try:
            with self._translated_errors(name, is_written=True):
                self._obstore.put(self._store, name, content, mode="create", attributes={_PUBLISHER: publisher})
        except self._obstore.exceptions.AlreadyExistsError:
            # The file is ours if the response to a first attempt was lost and obstore retried.
            with self._reading(name):
                found = self._obstore.get(self._store, name, options={"head": True}).attributes
            return bool(found.get(_PUBLISHER) == publisher)
        return True

    def delete(self, names: Sequence[str]) -> None:
        """Remove files; missing ones are ignored."""
        with self._translated_errors(names[0] if names else ""):
            self._obstore.delete(self._store, list(names))

    # --- errors -----------------------------------------------------------------------------------------

    @contextmanager
    def _reading(self, name: str) -> Iterator[None]:
        try:
            with self._translated_errors(name):
                yield
        except FileGone:
            raise
        except FileNotFoundError as error:
            raise FileGone(
                f"{self.url}/{name}: gone; `scenarionet fsck` lists what is affected: restore the file from a "
                "copy of the lake, or convert its recordings again"
            ) from error

    @contextmanager
    def _translated_errors(self, name: str, *, is_written: bool = False) -> Iterator[None]:
        """Convert errors of the store into a LakeError that names the remedy.

        Errors for missing and for existing files pass through, except that a missing file on write means a missing
        bucket.
        """
        exceptions, place = self._obstore.exceptions, f"{self.url}/{name}".rstrip("/.")
        try:
            yield
        except exceptions.AlreadyExistsError:
            raise
        except FileNotFoundError as error:
            if not is_written:
                raise
            raise self._no_bucket() from error
        except (exceptions.PermissionDeniedError, exceptions.UnauthenticatedError) as error:
            raise LakeError(
                f"{place}: permission denied; set credentials with read and write access (AWS_ACCESS_KEY_ID, ...), "
                f"`scenarionet doctor {self.url}` lists the settings"
            ) from error
        except exceptions.BaseError as error:
            answer = re.search(r"status code: ([^:]*)", str(error))
            if answer and answer.group(1).startswith("404"):
                raise self._no_bucket() from error
            raise LakeError(
                f"{place}: the object store answers {answer.group(1) if answer else _first_line(error)}; retried for "
                f"up to {patience():.0f} s ($SCENARIONET_PATIENCE). Committed data is safe: run the same command again "
                "when the object store is available"
            ) from error

    def _no_bucket(self) -> LakeError:
        return LakeError(f"{self.url}: no such bucket; create it, or check the name and the settings")


def endpoint() -> str | None:
    """URL of an S3-compatible server other than Amazon's, if one is set."""
    return next((os.environ[name] for name in _ENDPOINTS if os.environ.get(name)), None)


def patience() -> float:
    """Seconds for which failing requests are retried: ``$SCENARIONET_PATIENCE``."""
    return float(os.environ.get("SCENARIONET_PATIENCE") or 180)


def _options(scheme: str) -> dict[str, Any]:
    """Options for opening a store, in addition to those in the environment."""
    longest_wait = max(0.2, min(15.0, patience() / 4))
    chosen: dict[str, Any] = {
        "client_options": {"allow_http": (endpoint() or "").startswith("http://"), "timeout": "60s"},
        "retry_config": {
            "max_retries": 20,
            "retry_timeout": timedelta(seconds=patience()),
            "backoff": {
                "init_backoff": timedelta(seconds=0.1),
                "max_backoff": timedelta(seconds=longest_wait),
                "base": 2,
            },
        },
    }
    if scheme == "s3" and endpoint():
        chosen["config"] = {"endpoint": endpoint()}
    return chosen


def _stored(meta: Any) -> Stored:
    return Stored(meta["path"], int(meta["size"]), str(meta["e_tag"]), meta["last_modified"].timestamp())


def _folder_of(path: str, names: Collection[str]) -> str | None:
    """The outermost folder of a path with one of these names; None without one."""
    folders = path.split("/")[:-1]
    place = next((place for place, folder in enumerate(folders) if folder in names), None)
    return None if place is None else "/".join(folders[: place + 1])


def _first_line(error: Exception) -> str:
    """The first line of a message; the following ones describe library internals."""
    return str(error).partition("\n")[0]


def _refuse_after_fork(url: str) -> None:
    """Raise in a forked child, which would hang: it inherits locks of network threads, but not the threads."""
    global _first_used_by
    _first_used_by = _first_used_by or os.getpid()
    if _first_used_by != os.getpid():
        raise LakeError(
            f"{url}: this process was forked from one that uses an object store; start workers by spawn "
            "(for torch: DataLoader(..., multiprocessing_context='spawn'))"
        )
