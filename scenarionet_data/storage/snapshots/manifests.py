"""Manifests: the Parquet files of a snapshot that list its shards."""

from __future__ import annotations

import hashlib
from collections.abc import Iterable, Sequence
from functools import cache
from operator import itemgetter
from typing import Any

import pyarrow as pa
import pyarrow.compute as pc

from scenarionet_data.errors import SchemaMismatch
from scenarionet_data.schema import tables
from scenarionet_data.storage.files.lake_files import LakeFiles
from scenarionet_data.storage.snapshots import snapshot as snapshots
from scenarionet_data.storage.snapshots.shard_record import ShardRecord
from scenarionet_data.storage.snapshots.snapshot import Snapshot
from scenarionet_data.storage.write.table_file import publish_table

_MAX_MANIFESTS = 16
_ORDER = [(name, "ascending") for name in ("dataset", "version", "split", "name", "key")]

NO_FILES = tables.load("shards").schema.empty_table().select(["metadata_file", "files", "sizes", "checksums"])
"""No rows of those columns of a manifest that name files."""


def shard_table(files: LakeFiles, snapshot: Snapshot) -> pa.Table:
    """All shards of a snapshot as rows of ``schemas/shards.toml``, ordered by partition and name."""
    schema = tables.load("shards").schema
    with snapshots.reading_from(files, snapshot):
        parts = _read_all(files, snapshot.manifests)
    together = pa.concat_tables([schema.empty_table(), *parts])
    return together.sort_by(_ORDER)


def column(files: LakeFiles, snapshot: Snapshot, name: str) -> pa.ChunkedArray:
    """One column of :func:`shard_table`, in any order."""
    chunks = list[pa.Array]()
    with snapshots.reading_from(files, snapshot):
        for rows in _read_all(files, snapshot.manifests, [name]):
            chunks += rows[name].chunks
    return pa.chunked_array(chunks, tables.load("shards").schema.field(name).type)


def shards(files: LakeFiles, snapshot: Snapshot) -> list[ShardRecord]:
    """All shards of a snapshot as records."""
    return [ShardRecord(**row) for row in shard_table(files, snapshot).to_pylist()]


def shared_maps(files: LakeFiles, snapshot: Snapshot) -> dict[tuple[str, str, str], str]:
    """File of each map that scenarios share, by dataset, version and map id."""
    listed = shard_table(files, snapshot).filter(pc.field("split") == "").to_pylist()
    return {(row["dataset"], row["version"], row["name"]): row["files"][0] for row in listed}


def read(files: LakeFiles, name: str, columns: list[str] | None = None) -> pa.Table:
    """Shards listed in a manifest.

    Raises:
        LakeError: The manifest is missing or damaged, or has a schema version that cannot be read.
    """
    return _read_all(files, [name], columns)[0]


def read_files(files: LakeFiles, name: str) -> pa.Table:
    """Files of the shards listed in a manifest, as rows of NO_FILES.

    Raises:
        LakeError: The manifest is missing or damaged, or has a schema version that cannot be read.
    """
    rows = files.read(name, NO_FILES.column_names)
    tables.load("shards").check_version(rows.schema.metadata, name)
    return rows.cast(NO_FILES.schema)


def _read_all(files: LakeFiles, names: Sequence[str], columns: list[str] | None = None) -> list[pa.Table]:
    found, table = files.read_all(names, columns), tables.load("shards")
    for number, name in enumerate(names):
        table.check_version(found[number].schema.metadata, name)
        found[number] = table.conform(found[number], columns)
    return found


def schema_versions(files: LakeFiles, snapshot: Snapshot) -> set[str]:
    """Versions of tables, as ``tracks/1``, under which all shards of a snapshot were written.

    Raises:
        SchemaMismatch: The message names a shard, both versions and the remedy.
    """
    found = column(files, snapshot, "schemas").to_pylist()
    common = set(tables.content_tag().split())
    for tag in set(found):
        common.intersection_update(tag.split())
        if tag != tables.content_tag() and not tables.reads_content(tag):
            name = column(files, snapshot, "name")[found.index(tag)].as_py()
            raise SchemaMismatch(
                f"{files.root}: shard {name} was written under {tag}, this version reads {tables.content_tag()}; "
                "convert its recordings again with replace=True, or use the version of this software that wrote them"
            )
    return common


def write(files: LakeFiles, base: Snapshot, added: Iterable[ShardRecord], removed: frozenset[str]) -> tuple[str, ...]:
    """Write the manifests of ``base`` with shards added and (by key) removed.

    Adds one manifest; merges all into one when shards are removed or there are more than 16.
    """
    rows: list[dict[str, Any]] = list(map(vars, added))
    is_added = not removed and len(base.manifests) < _MAX_MANIFESTS
    if is_added and not rows:
        return base.manifests
    if not is_added:
        rows += [row for row in shard_table(files, base).to_pylist() if row["key"] not in removed]
    rows.sort(key=itemgetter("key"))
    # The name of the metadata file changes when a shard is rewritten to other files.
    identity = "\n".join([f"{row['key']} {row['metadata_file']}" for row in rows])
    name = f"{snapshots.FOLDER}/manifest-{hashlib.blake2b(identity.encode(), digest_size=8).hexdigest()}.parquet"
    publish_table(files, "shards", rows, {}, name)
    return (*base.manifests, name) if is_added else (name,)


class NamedFiles:
    """Files referenced by snapshots; each manifest is read once.

    Args:
        files: The lake.

    Attributes:
        listed: Returns the files of the shards in a manifest.
    """

    def __init__(self, files: LakeFiles) -> None:
        self._files = files
        self.listed = cache(self._read)

    def of(self, needed: Iterable[Snapshot]) -> set[str]:
        """All files that some snapshots need, including those that their next consolidations read."""
        lists, named = set[str](), set[str]()
        for snapshot in needed:
            lists.update(snapshot.manifests)
            named.update(snapshot.metadata)
            named.add(snapshots.order_file(snapshot.metadata))
        return named.union(lists, *map(self.listed, lists))

    def _read(self, manifest: str) -> frozenset[str]:
        rows = read(self._files, manifest, ["metadata_file", "files"])
        names = rows["metadata_file"].drop_null().to_pylist()
        return frozenset(names).union(pc.unique(pc.list_flatten(rows["files"])).to_pylist())
