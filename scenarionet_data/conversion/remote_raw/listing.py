"""Raw recordings in an object store, as converters list them: names, sizes, marks, and the few files they read."""

from __future__ import annotations

import hashlib
import os
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import closing, contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit

from scenarionet_data.conversion.remote_raw.scratch import Scratch
from scenarionet_data.converters.base import Converter
from scenarionet_data.errors import BadParameter, FileGone, ScenarioNetError, SourceNotFound
from scenarionet_data.ingest.input_properties import PLACEHOLDER
from scenarionet_data.ingest.shard import Options, Shard
from scenarionet_data.storage.files.errors import writing
from scenarionet_data.storage.files.object_store import ObjectStore, Stored
from scenarionet_data.storage.files.opening import is_url

AT_ONCE = 16
"""Downloads in flight."""


class RawPlace:
    """Where raw recordings are listed: their folder, or one that looks like theirs in the object store.

    Args:
        folder: What converters list.
        top: The folder that stands for the bucket, if one does.
        bucket: The bucket's URL.
    """

    def __init__(self, folder: str, top: str = "", bucket: str = "") -> None:
        self.folder, self.top = folder, top
        self._bucket = bucket

    def place(self, shard: Shard) -> Shard:
        """The shard, whose root and places are where the recordings really are."""
        return moved(shard, self.top, self._bucket) if self._bucket else shard


@contextmanager
def listing(converter: Converter[Any], raw: str, options: Options) -> Iterator[RawPlace]:
    """Where a converter lists its recordings.

    Files in an object store are listed once. Those that the converter reads to list them are fetched. Each other one
    becomes a placeholder of the same name, size and time that holds the store's mark of its content, so that
    fingerprints change when it does. Errors name places in the store.

    Raises:
        BadParameter: An option says that something else lies in an object store.
        SourceNotFound: There is nothing.
        LakeError: The store does not answer.
    """
    _refuse_urls(options)
    if urlsplit(raw).scheme == "file":
        raw = urlsplit(raw).path
    if not is_url(raw):
        yield RawPlace(raw)
        return
    raw = raw.rstrip("/")
    with closing(Scratch()) as scratch:
        top, bucket = str(scratch.path), bucket_of(raw)
        folder = Path(raw.replace(bucket, top, 1))
        _list(converter, raw, folder)
        above = converter.dataset_folder(folder)
        if above != folder:
            _list(converter, str(above).replace(top, bucket, 1), above)
        try:
            yield RawPlace(str(folder), top, bucket)
        except ScenarioNetError as error:
            rename(error, top, bucket)
            raise


def bucket_of(url: str) -> str:
    """The URL of the bucket in which something lies."""
    return "{0.scheme}://{0.netloc}".format(urlsplit(url))


def moved(shard: Shard, old: str, new: str) -> Shard:
    """The shard, whose root and places lie below ``new`` and no longer below ``old``; what lies elsewhere stays."""

    def move(paths: str) -> str:
        return f"{paths}/".replace(f"{old}/", f"{new}/")[:-1]

    places = {name: move(paths) for name, paths in shard.options.places.items()}
    return replace(shard, root=move(shard.root), options=replace(shard.options, **places) if places else shard.options)


def rename(error: Exception, old: str, new: str) -> None:
    """Let an error that names a file below ``old`` name the one below ``new`` for which it stood."""
    error.args = tuple(each.replace(old, new) if isinstance(each, str) else each for each in error.args)
    for name, value in vars(error).items():
        if isinstance(value, str):
            setattr(error, name, value.replace(old, new))


def _refuse_urls(options: Options) -> None:
    for name, place in options.places.items():
        if is_url(place):
            raise BadParameter(
                f"{name}: {place} is no folder on this machine; give one, or leave {name} out: what lies below RAW in "
                "an object store is found there"
            )


def _list(converter: Converter[Any], url: str, folder: Path) -> None:
    """Let a folder look like what is below a URL."""
    store, read = ObjectStore(url), []
    for each in _objects(store, converter):
        file = folder / each.name if each.name else folder
        if any(file.match(pattern) for pattern in converter.listed):
            read.append((each, file))
        else:
            _put_placeholder(each, file)
    with ThreadPoolExecutor(AT_ONCE) as pool:
        list(pool.map(lambda pair: _fetch(store, *pair), read))


def _objects(store: ObjectStore, converter: Converter[Any]) -> Iterator[Stored]:
    """Every file below a URL that a converter may read; of the one file that it names, with an empty name."""
    found = False
    for each in store.walk(ignored=converter.ignored):
        found = True
        yield each
    if not found:
        parent, _, name = store.url.rpartition("/")
        one = None if store.url == bucket_of(store.url) else ObjectStore(parent).find(name)
        if one is None:
            raise SourceNotFound(f"{store.url}: nothing there; list the bucket to see its folders")
        yield replace(one, name="")


def _put_placeholder(each: Stored, file: Path) -> None:
    with writing(file):
        _make_folder(file.parent)
        if file.is_dir():  # an empty file of a folder's name: some tools make folders so
            return
        head = PLACEHOLDER + hashlib.blake2b(each.mark.encode(), digest_size=16).digest()
        file.write_bytes(head)
        os.truncate(file, max(each.size, len(head)))
        os.utime(file, (each.modified, each.modified))


def _make_folder(folder: Path) -> None:
    """Make a folder, in place of the empty file that some tools put where a folder is."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except (FileExistsError, NotADirectoryError):
        next(path for path in (folder, *folder.parents) if path.is_file()).unlink()
        folder.mkdir(parents=True, exist_ok=True)


def _fetch(store: ObjectStore, each: Stored, file: Path) -> None:
    with writing(file):
        _make_folder(file.parent)
    try:
        store.download(each.name, file)
    except FileGone as error:
        raise SourceNotFound(
            f"{store.url}/{each.name}: gone since it was listed; run the same command again"
        ) from error
    os.utime(file, (each.modified, each.modified))
