"""An object store behind obstore: opened by URL, patient with errors, its refusals in our words.

Credentials, region and endpoint come from the environment that every tool for object stores knows
(``AWS_ACCESS_KEY_ID``, ``AWS_ENDPOINT_URL``, ``GOOGLE_APPLICATION_CREDENTIALS``, ...).
"""

from __future__ import annotations

import os
import re
import time
import uuid
from collections import deque
from collections.abc import Collection, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from datetime import timedelta
from pathlib import Path
from typing import Any

from scenarionet_data.errors import FileGone, LakeError, MissingDependency
from scenarionet_data.storage.files.errors import writing
from scenarionet_data.version import PACKAGE

SCHEMES = ("s3", "gs")
_ENDPOINTS = ("AWS_ENDPOINT_URL_S3", "AWS_ENDPOINT_URL", "AWS_ENDPOINT")
_PUBLISHER = "publisher"
_PAGE = 1000
"""Files that a store names in one answer."""

_ANSWERS = 4
"""Small answers whose quickest tells how far away a store is."""

_first_used_by: int | None = None


@dataclass(frozen=True)
class Stored:
    """A file in an object store.

    Attributes:
        name: Below the store's URL.
        size: Bytes.
        mark: Changes when the content does (its ETag).
        modified: When it was put there [s since 1970, on the store's clock].
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
        LakeError: The URL is of a kind that is not known, or what the environment says cannot be.
        MissingDependency: obstore is not installed.
    """

    def __init__(self, url: str) -> None:
        self.url = url
        try:
            import obstore
        except ImportError as error:
            raise MissingDependency(f"{url} needs obstore; pip install '{PACKAGE}[remote]'") from error
        scheme, _, place = url.partition("://")
        if scheme not in SCHEMES or not place.strip("/"):
            raise LakeError(f"{url}: wanted a folder, s3://BUCKET/PREFIX, gs://BUCKET/PREFIX or file:///FOLDER")
        _refuse_after_fork(url)
        self._obstore: Any = obstore
        self._answer_times: deque[float] = deque(maxlen=_ANSWERS)
        try:
            self._store: Any = obstore.store.from_url(url, **_options(scheme))
        except (obstore.exceptions.BaseError, ValueError) as error:
            raise LakeError(f"{url}: {_first_line(error)}; `scenarionet doctor {url}` says what is set") from error

    # --- what is there --------------------------------------------------------------------------------

    def list(self, folder: str) -> tuple[list[Stored], list[str]]:
        """Files directly in a folder, and the names of the folders in it."""
        with self._asking(folder), self._timed():
            found = self._obstore.list_with_delimiter(self._store, None if folder == "." else folder)
        return [_stored(each) for each in found["objects"]], [
            each.rstrip("/").rpartition("/")[2] for each in found["common_prefixes"]
        ]

    def walk(self, folder: str | None = None, ignored: Collection[str] = ()) -> Iterator[Stored]:
        """Every file below a folder, at any depth, but for what lies in folders of the ignored names.

        Where a page ends in such a folder, which may hold millions of files, the next one begins behind it: a store
        lists in the order of names, and ``0`` is what comes after ``/``.
        """
        behind: str | None = None
        with self._asking(folder or ""):
            pages = self._pages(folder, behind)
            while page := next(pages, None):
                yield from (_stored(each) for each in page if not _folder_of(each["path"], ignored))
                behind = _folder_of(page[-1]["path"], ignored)
                if behind:
                    pages = self._pages(folder, f"{behind}0")

    def _pages(self, folder: str | None, behind: str | None) -> Iterator[Any]:
        return iter(self._obstore.list(self._store, folder, offset=behind, chunk_size=_PAGE))

    def find(self, name: str) -> Stored | None:
        """A file; None when it is not there."""
        try:
            with self._asking(name), self._timed():
                return _stored(self._obstore.head(self._store, name))
        except FileNotFoundError:
            return None

    # --- reading, of what is there or FileGone ----------------------------------------------------------

    def download(self, name: str, path: Path) -> Stored:
        """Write a file to one on this machine."""
        with self._reading(name):
            got = self._obstore.get(self._store, name)
            with writing(path, path), path.open("wb") as file:
                for piece in got.stream():
                    file.write(piece)
        return _stored(got.meta)

    def pieces(self, name: str) -> Iterator[bytes]:
        """A file's bytes, piece by piece."""
        with self._reading(name):
            yield from self._obstore.get(self._store, name).stream()

    def range(self, name: str, start: int, end: int) -> memoryview:
        """Bytes ``start`` to ``end`` (exclusive) of a file, as they arrived: a copy of megabytes takes milliseconds."""
        with self._reading(name):
            return memoryview(self._obstore.get_range(self._store, name, start=start, end=end))

    def last(self, name: str, length: int) -> tuple[int, bytes]:
        """Size of a file, and at most its last ``length`` bytes."""
        with self._reading(name):
            got = self._obstore.get(self._store, name, options={"range": {"suffix": length}})
            return int(got.meta["size"]), bytes(got.bytes())

    # --- writing ----------------------------------------------------------------------------------------

    def put(self, name: str, content: Path | bytes) -> str:
        """Put a file there, in place of one of that name; returns its mark."""
        with self._asking(name, is_written=True):
            return str(self._obstore.put(self._store, name, content)["e_tag"])

    def create(self, name: str, content: bytes) -> bool:
        """Put a file there unless there is one; returns whether this call did."""
        publisher = uuid.uuid4().hex
        try:
            with self._asking(name, is_written=True):
                self._obstore.put(self._store, name, content, mode="create", attributes={_PUBLISHER: publisher})
        except self._obstore.exceptions.AlreadyExistsError:
            # Ours, when the answer to a first attempt was lost and the store was asked again.
            with self._reading(name):
                found = self._obstore.get(self._store, name, options={"head": True}).attributes
            return bool(found.get(_PUBLISHER) == publisher)
        return True

    def delete(self, names: Sequence[str]) -> None:
        """Remove files; those that are not there are as wanted."""
        with self._asking(names[0] if names else ""):
            self._obstore.delete(self._store, list(names))

    # --- how far away it is -----------------------------------------------------------------------------

    @property
    def answer_time(self) -> float | None:
        """How long an answer takes [s]: the quickest of the last few small ones; None before the first."""
        return min(self._answer_times, default=None)

    @contextmanager
    def _timed(self) -> Iterator[None]:
        started = time.perf_counter()
        yield
        self._answer_times.append(time.perf_counter() - started)

    # --- refusals ---------------------------------------------------------------------------------------

    @contextmanager
    def _reading(self, name: str) -> Iterator[None]:
        try:
            with self._asking(name):
                yield
        except FileGone:
            raise
        except FileNotFoundError as error:
            raise FileGone(
                f"{self.url}/{name}: gone; `scenarionet fsck` says what of the lake is hit: restore the file from a "
                "copy of the lake, or convert its recordings again"
            ) from error

    @contextmanager
    def _asking(self, name: str, *, is_written: bool = False) -> Iterator[None]:
        """Turns what a store refuses into a LakeError with the remedy.

        That a file is not there, or there already, passes: whoever asks knows what it means. What is written is
        only not there when the bucket is not.
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
                f"{place}: refused; set credentials that may read and write there (AWS_ACCESS_KEY_ID and the like), "
                f"`scenarionet doctor {self.url}` says what is set"
            ) from error
        except exceptions.BaseError as error:
            answer = re.search(r"status code: ([^:]*)", str(error))
            if answer and answer.group(1).startswith("404"):
                raise self._no_bucket() from error
            raise LakeError(
                f"{place}: the object store answers {answer.group(1) if answer else _first_line(error)}; asked for up "
                f"to {patience():.0f} s ($SCENARIONET_PATIENCE). What is committed is kept: run the same command again "
                "when the store is well"
            ) from error

    def _no_bucket(self) -> LakeError:
        return LakeError(f"{self.url}: no such bucket; make it first, or check the name and what is set")


def endpoint() -> str | None:
    """The S3 server that is not Amazon's, if one is set."""
    return next((os.environ[name] for name in _ENDPOINTS if os.environ.get(name)), None)


def patience() -> float:
    """Seconds for which a request is tried again when the store answers with errors: ``$SCENARIONET_PATIENCE``."""
    return float(os.environ.get("SCENARIONET_PATIENCE") or 180)


def _options(scheme: str) -> dict[str, Any]:
    """What stores are opened with besides what the environment says."""
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
    """The outermost folder of one of these names in which a file lies; None when it lies in none."""
    folders = path.split("/")[:-1]
    place = next((place for place, folder in enumerate(folders) if folder in names), None)
    return None if place is None else "/".join(folders[: place + 1])


def _first_line(error: Exception) -> str:
    """The first line of a message, which goes on with what happened inside the library."""
    return str(error).partition("\n")[0]


def _refuse_after_fork(url: str) -> None:
    """A forked child has the locks of the parent's network threads without the threads: it would wait for ever."""
    global _first_used_by
    _first_used_by = _first_used_by or os.getpid()
    if _first_used_by != os.getpid():
        raise LakeError(
            f"{url}: this process was forked from one that talks to an object store; start workers by spawn "
            "(for torch: DataLoader(..., multiprocessing_context='spawn'))"
        )
