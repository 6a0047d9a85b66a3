"""Raw recordings in an object store: listed without reading them, and on a worker's disk while a shard is converted."""

from __future__ import annotations

import hashlib
import os
import tempfile
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit

from scenarionet_data.converters.base import Converter, Shard
from scenarionet_data.errors import BadParameter, FileGone, SourceNotFound
from scenarionet_data.store.file_errors import writing
from scenarionet_data.store.files import is_url
from scenarionet_data.store.object_store import ObjectStore, Stored

_AT_ONCE = 16
"""Downloads in flight."""


class RawPlace:
    """Where raw recordings are listed: their folder, or one that looks like theirs in the object store.

    Args:
        raw: The raw recordings, as the user gave them.
        folder: What converters list.
    """

    def __init__(self, raw: str, folder: str) -> None:
        self._url = raw if is_url(raw) else None
        self._folder = Path(folder)
        self.folder = folder

    def place(self, shard: Shard) -> Shard:
        """The shard, whose root is where the recordings really are."""
        if self._url is None:
            return shard
        base = self._url.removesuffix(f"/{self._folder.name}") if self._folder.is_file() else self._url
        top = self._folder.parent if self._folder.is_file() else self._folder
        below = Path(shard.root).relative_to(top).as_posix()
        return replace(shard, root=base if below == "." else f"{base}/{below}")


@contextmanager
def listing(converter: Converter[Any], raw: str) -> Iterator[RawPlace]:
    """Where a converter lists its recordings.

    Files in an object store are listed once. Each becomes a file without content, of the same name and size, that
    begins with the store's mark of its content, so that fingerprints change when it does.

    Raises:
        BadParameter: The converter reads files to list them.
        SourceNotFound: There is nothing.
        LakeError: The store does not answer.
    """
    if not is_url(raw):
        yield RawPlace(raw, raw)
        return
    if urlsplit(raw).scheme == "file":
        path = urlsplit(raw).path
        yield RawPlace(path, path)
        return
    raw = raw.rstrip("/")
    if not converter.downloads:
        raise BadParameter(f"{raw}: {converter.name} looks into its files to list them; copy them to a folder first")
    with tempfile.TemporaryDirectory(prefix="scenarionet-") as temporary:
        folder = Path(temporary, *urlsplit(raw).path.strip("/").split("/"))
        for each in _objects(raw):
            file = folder / each.name if each.name else folder
            file.parent.mkdir(parents=True, exist_ok=True)
            file.write_bytes(hashlib.blake2b(each.mark.encode(), digest_size=16).digest()[: each.size])
            os.truncate(file, each.size)
        yield RawPlace(raw, str(folder))


@contextmanager
def at_hand(converter: Converter[Any], shard: Shard) -> Iterator[Shard]:
    """The shard with its files on this machine; what was downloaded for it goes afterwards."""
    if not is_url(shard.root):
        yield shard
        return
    with tempfile.TemporaryDirectory(prefix="scenarionet-") as folder, ThreadPoolExecutor(_AT_ONCE) as pool:
        store = ObjectStore(shard.root)
        names = sorted({name for item in shard.items for name in _needed(store, item.name, converter.downloads)})
        for _ in pool.map(lambda name: _fetch(store, name, Path(folder, name)), names):
            pass
        yield replace(shard, root=folder)


def _objects(url: str) -> Iterator[Stored]:
    """Every file below a URL; of the one file that it names, with an empty name."""
    found = False
    for each in ObjectStore(url).walk():
        found = True
        yield each
    if not found:
        parent, _, name = url.rpartition("/")
        one = ObjectStore(parent).find(name)
        if one is None:
            raise SourceNotFound(f"{url}: nothing there; list the bucket to see its folders")
        yield replace(one, name="")


def _needed(store: ObjectStore, item: str, downloads: str) -> list[str]:
    """Names of the files that an item needs."""
    folder = item.rpartition("/")[0]
    return [item] if downloads == "files" or not folder else [each.name for each in store.walk(folder)]


def _fetch(store: ObjectStore, name: str, path: Path) -> None:
    with writing(path):
        path.parent.mkdir(parents=True, exist_ok=True)
    try:
        store.download(name, path)
    except FileGone as error:
        raise SourceNotFound(f"{store.url}/{name}: gone since it was listed; run the same command again") from error
