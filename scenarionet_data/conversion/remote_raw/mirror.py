"""Mirror of raw recordings in an object store, as converters list them: names, sizes and the few files they read."""

from __future__ import annotations

import hashlib
import os
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import closing, contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit

from scenarionet_data.conversion.remote_raw.scratch import ScratchFolder
from scenarionet_data.converters.base import Converter
from scenarionet_data.errors import FileGone, ScenarioNetError, SourceNotFound
from scenarionet_data.ingest.input_properties import PLACEHOLDER
from scenarionet_data.ingest.shard import Shard
from scenarionet_data.storage.files.errors import writing
from scenarionet_data.storage.files.object_store import ObjectStore, Stored

MAX_CONNECTIONS = 16
"""Downloads in flight."""


@dataclass(frozen=True)
class Mirror:
    """A folder that mirrors the listing of recordings in an object store.

    Attributes:
        folder: The folder to list.
        top: The folder above it that corresponds to the bucket.
        bucket: The bucket's URL.
    """

    folder: str
    top: str
    bucket: str

    def original(self, shard: Shard) -> Shard:
        """A shard listed in the mirror, with the original location of its recordings."""
        return relocated(shard, self.top, self.bucket)


@contextmanager
def mirrored(converter: Converter[Any], url: str) -> Iterator[Mirror]:
    """Mirror the recordings at a URL, until the block ends.

    The files in the object store are listed once. Those that the converter reads to list its shards are downloaded.
    Every other file becomes a placeholder of the same name, size and modification time that contains the ETag, so that
    fingerprints change with the content. Paths in errors are rewritten to URLs.

    Raises:
        SourceNotFound: Nothing is there.
        LakeError: The store does not answer.
    """
    url = url.rstrip("/")
    with closing(ScratchFolder()) as scratch:
        top, bucket = str(scratch.path), bucket_of(url)
        folder = Path(url.replace(bucket, top, 1))
        _mirror_folder(converter, url, folder)
        above = converter.dataset_folder(folder)
        if above != folder:
            _mirror_folder(converter, str(above).replace(top, bucket, 1), above)
        try:
            yield Mirror(str(folder), top, bucket)
        except ScenarioNetError as error:
            rename_paths(error, top, bucket)
            raise


def bucket_of(url: str) -> str:
    """URL of the bucket of a URL."""
    return "{0.scheme}://{0.netloc}".format(urlsplit(url))


def relocated(shard: Shard, old: str, new: str) -> Shard:
    """The shard with its root and option paths below ``new`` instead of ``old``; other paths stay."""

    def move(paths: str) -> str:
        return f"{paths}/".replace(f"{old}/", f"{new}/")[:-1]

    paths: dict[str, Any] = {name: move(value) if value else value for name, value in shard.options.paths.items()}
    return replace(shard, root=move(shard.root), options=replace(shard.options, **paths) if paths else shard.options)


def rename_paths(error: Exception, old: str, new: str) -> None:
    """Rewrite paths in an error message, from the local copy to the original location."""
    if old == new:
        return
    error.args = tuple(each.replace(old, new) if isinstance(each, str) else each for each in error.args)
    for name, value in vars(error).items():
        if isinstance(value, str):
            setattr(error, name, value.replace(old, new))


def _mirror_folder(converter: Converter[Any], url: str, folder: Path) -> None:
    """Fill a folder with downloads and placeholders of all files below a URL."""
    store, to_read = ObjectStore(url), []
    for each in _objects(store, converter):
        file = folder / each.name if each.name else folder
        if any(file.match(pattern) for pattern in converter.listed):
            to_read.append((each, file))
        else:
            _write_placeholder(each, file)
    with ThreadPoolExecutor(MAX_CONNECTIONS) as pool:
        list(pool.map(lambda pair: _download(store, *pair), to_read))


def _objects(store: ObjectStore, converter: Converter[Any]) -> Iterator[Stored]:
    """Every file below a URL that a converter may read; for the URL of a file, that file with an empty name."""
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


def _write_placeholder(each: Stored, file: Path) -> None:
    with writing(file):
        _make_folder(file.parent)
        if file.is_dir():  # an empty object with a folder's name: some tools create folders like this
            return
        head = PLACEHOLDER + hashlib.blake2b(each.mark.encode(), digest_size=16).digest()
        file.write_bytes(head)
        os.truncate(file, max(each.size, len(head)))
        os.utime(file, (each.modified, each.modified))


def _make_folder(folder: Path) -> None:
    """Make a folder, replacing an empty file of its name (see :func:`_write_placeholder`)."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except (FileExistsError, NotADirectoryError):
        next(path for path in (folder, *folder.parents) if path.is_file()).unlink()
        folder.mkdir(parents=True, exist_ok=True)


def _download(store: ObjectStore, each: Stored, file: Path) -> None:
    with writing(file):
        _make_folder(file.parent)
    try:
        store.download(each.name, file)
    except FileGone as error:
        raise SourceNotFound(
            f"{store.url}/{each.name}: deleted since it was listed; run the same command again"
        ) from error
    os.utime(file, (each.modified, each.modified))
