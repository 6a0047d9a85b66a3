"""An object store, accessed through obstore: opened by URL, with retries and error messages that name the remedy.

Credentials, region and endpoint come from the usual environment variables
(``AWS_ACCESS_KEY_ID``, ``AWS_ENDPOINT_URL``, ``GOOGLE_APPLICATION_CREDENTIALS``, ...). No response is taken for whole
before its length has been compared with the one that the store announced.
"""

from __future__ import annotations

import uuid
from collections.abc import Callable, Collection, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any, TypeVar

from scenarionet_data.errors import FileGone, LakeError
from scenarionet_data.storage.files.errors import writing
from scenarionet_data.storage.files.retries import Attempts, CutOff, GaveUp, patience, status
from scenarionet_data.storage.files.store_client import connect, first_line

_PUBLISHER = "publisher"
_PAGE = 1000
"""Files in one page of a listing."""

_RUN_AGAIN = "Committed data is safe: run the same command again when the object store is available"
_MAY_EXIST = (
    "Committed data is safe, but this file may have been created although the answer did not arrive: see whether it is "
    "there when the object store is available, and run the same command again if not"
)

Answer = TypeVar("Answer")


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
        self._store = connect(url)
        import obstore  # lazy: optional

        self._obstore: Any = obstore

    # --- listing ----------------------------------------------------------------------------------------

    def list(self, folder: str) -> tuple[list[Stored], list[str]]:
        """Files directly in a folder, and the names of the folders in it."""
        prefix = None if folder == "." else folder
        found = self._request(folder, lambda: self._obstore.list_with_delimiter(self._store, prefix))
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
        """Pages of a listing; a failed request is repeated after the last file of the page before."""
        list_after = partial(self._obstore.list, self._store, folder, chunk_size=_PAGE)
        pages, attempts = list_after(offset=behind), Attempts()
        while True:
            try:
                page = next(pages, None)
            except self._obstore.exceptions.BaseError as error:
                attempts.failed(error)
                pages = list_after(offset=behind)
                continue
            if not page:
                return
            behind, attempts = page[-1]["path"], Attempts()
            yield page

    def find(self, name: str) -> Stored | None:
        """A file; None when it does not exist."""
        try:
            return _stored(self._request(name, lambda: self._obstore.head(self._store, name)))
        except FileNotFoundError:
            return None

    # --- reading; a missing file raises FileGone --------------------------------------------------------

    def download(self, name: str, path: Path) -> Stored:
        """Download a file to a local path."""
        with writing(path, path), path.open("wb") as file:
            pieces = self._stream(name)  # at least one
            stored, first = next(pieces)
            file.write(first)
            for _, piece in pieces:
                file.write(piece)
        return stored

    def pieces(self, name: str) -> Iterator[bytes]:
        """Stream a file's bytes."""
        return (piece for _, piece in self._stream(name))

    def _stream(self, name: str) -> Iterator[tuple[Stored, bytes]]:
        """A file with its pieces, at least one; if a response is cut off, the rest is requested."""
        stored: Stored | None = None
        position, attempts = 0, Attempts()
        with self._reading(name), self._translated_errors(name):
            while stored is None or position < stored.size:
                try:
                    got = self._obstore.get(
                        self._store, name, options={"range": {"offset": position}} if position else {}
                    )
                    found = _stored(got.meta)
                    if stored is not None and found.mark != stored.mark:
                        raise LakeError(f"{self.url}/{name}: replaced while it was read; run the same command again")
                    stored = found
                    for piece in got.stream() if stored.size else [b""]:
                        position += len(piece)
                        yield stored, piece
                        attempts = Attempts()
                    _check_length(position, stored.size)
                except (self._obstore.exceptions.BaseError, CutOff) as error:
                    attempts.failed(error)

    def range(self, name: str, start: int, end: int) -> memoryview:
        """Bytes ``start`` to ``end`` (exclusive) of a file, without a copy (megabytes take milliseconds)."""

        def get() -> memoryview:
            got = memoryview(self._obstore.get_range(self._store, name, start=start, end=end))
            if len(got) < end - start:
                size = int(self._obstore.head(self._store, name)["size"])
                _check_length(len(got), min(end, size) - start)
            return got

        with self._reading(name):
            return self._request(name, get)

    def last(self, name: str, length: int) -> tuple[int, bytes]:
        """Size of a file, and at most its last ``length`` bytes."""

        def get() -> tuple[int, bytes]:
            got = self._obstore.get(self._store, name, options={"range": {"suffix": length}})
            size, end = int(got.meta["size"]), bytes(got.bytes())
            _check_length(len(end), min(length, size))
            return size, end

        with self._reading(name):
            return self._request(name, get)

    # --- writing ----------------------------------------------------------------------------------------

    def put(self, name: str, content: Path | bytes) -> str:
        """Upload a file, replacing one of the same name; returns its ETag."""
        with self._writing():
            return str(self._request(name, lambda: self._obstore.put(self._store, name, content))["e_tag"])

    def create(self, name: str, content: bytes) -> bool:
        """Upload a file unless one of that name exists; returns whether this call created it.

        An upload whose answer was lost is repeated, and then finds its own file, recognised by its publisher.
        """
        publisher = uuid.uuid4().hex
        upload = partial(self._obstore.put, self._store, name, content, mode="create")
        try:
            with self._writing():
                self._request(name, lambda: upload(attributes={_PUBLISHER: publisher}), _MAY_EXIST)
        except self._obstore.exceptions.AlreadyExistsError:
            with self._reading(name):
                found = self._request(name, lambda: self._obstore.get(self._store, name, options={"head": True}))
            return bool(found.attributes.get(_PUBLISHER) == publisher)
        return True

    def delete(self, names: Sequence[str]) -> None:
        """Remove files; missing ones are ignored."""
        if names:
            self._request(names[0], lambda: self._obstore.delete(self._store, [*names]))

    # --- errors -----------------------------------------------------------------------------------------

    def _request(self, name: str, send: Callable[[], Answer], remedy: str = _RUN_AGAIN) -> Answer:
        """Send a request until it succeeds; errors are those of :meth:`_translated_errors`."""
        attempts = Attempts()
        with self._translated_errors(name, remedy):
            while True:
                try:
                    return send()
                except (self._obstore.exceptions.BaseError, CutOff) as error:
                    attempts.failed(error)

    @contextmanager
    def _reading(self, name: str) -> Iterator[None]:
        try:
            yield
        except FileGone:
            raise
        except FileNotFoundError as error:
            raise FileGone(
                f"{self.url}/{name}: gone; `scenarionet maintain fsck` lists what is affected: restore the file from a "
                "copy of the lake, or convert its recordings again"
            ) from error

    @contextmanager
    def _writing(self) -> Iterator[None]:
        try:
            yield
        except FileNotFoundError as error:  # not the file, which need not exist
            raise self._no_bucket() from error

    @contextmanager
    def _translated_errors(self, name: str, remedy: str = _RUN_AGAIN) -> Iterator[None]:
        """Convert errors of the store into a LakeError that names the remedy, except for missing and existing files."""
        exceptions, place = self._obstore.exceptions, f"{self.url}/{name}".rstrip("/.")
        try:
            yield
        except (exceptions.AlreadyExistsError, FileNotFoundError):
            raise
        except (exceptions.PermissionDeniedError, exceptions.UnauthenticatedError) as error:
            raise LakeError(
                f"{place}: permission denied; set credentials with read and write access (AWS_ACCESS_KEY_ID, ...), "
                f"`scenarionet maintain doctor {self.url}` lists the settings"
            ) from error
        except GaveUp as error:
            raise LakeError(
                f"{place}: {_answer(error.__cause__)}; retried for {error.seconds:.1f} s "
                f"($SCENARIONET_PATIENCE is {patience():g} s). {remedy}"
            ) from error
        except exceptions.BaseError as error:
            if (status(error) or "").startswith("404"):
                raise self._no_bucket() from error
            raise LakeError(
                f"{place}: {_answer(error)}; `scenarionet maintain doctor {self.url}` lists the settings"
            ) from error

    def _no_bucket(self) -> LakeError:
        return LakeError(f"{self.url}: no such bucket; create it, or check the name and the settings")


def _stored(meta: Any) -> Stored:
    return Stored(meta["path"], int(meta["size"]), str(meta["e_tag"]), meta["last_modified"].timestamp())


def _folder_of(path: str, names: Collection[str]) -> str | None:
    """The outermost folder of a path with one of these names; None without one."""
    folders = path.split("/")[:-1]
    place = next((place for place, folder in enumerate(folders) if folder in names), None)
    return None if place is None else "/".join(folders[: place + 1])


def _check_length(found: int, announced: int) -> None:
    if found != announced:
        raise CutOff(f"a response was cut off after {found:,} of {announced:,} bytes")


def _answer(error: BaseException | None) -> str:
    if isinstance(error, CutOff):
        return str(error)
    code = status(error) if error else None
    return f"the object store answers {code}" if code else f"the object store does not answer: {first_line(error)}"
