"""Metadata files of a lake: one per shard, or merged files in partitions with many shards.

The files depend only on the lake's shards, not on the order of the commits: up to MAX_METADATA_FILES shards of a
partition keep their own files; the rows of more shards are distributed over MERGED_FILES by a hash of the name.
"""

from __future__ import annotations

import hashlib
from collections import defaultdict
from collections.abc import Iterable, Sequence
from operator import attrgetter

import pyarrow as pa

from scenarionet_data.errors import LakeError
from scenarionet_data.schema import tables
from scenarionet_data.storage.files.lake_files import LakeFiles
from scenarionet_data.storage.snapshots import manifests
from scenarionet_data.storage.snapshots import snapshot as snapshots
from scenarionet_data.storage.snapshots.shard_record import ShardRecord
from scenarionet_data.storage.snapshots.snapshot import Snapshot
from scenarionet_data.storage.write.table_file import publish_table

MAX_METADATA_FILES = 64
"""Metadata files of a partition; more are merged (counting 3,000 files of 64 rows takes 0.7 s)."""

MERGED_FILES = 16
"""Metadata files of larger partitions; a new shard changes one of them."""

_ROWS_PER_GROUP = 65_536


def shard_files(records: Iterable[ShardRecord]) -> list[str]:
    """Metadata files that shards were written with; shared maps have none."""
    return list(filter(None, map(attrgetter("metadata_file"), records)))


def layout(names: Iterable[str]) -> dict[str, list[str]]:
    """Metadata files of a lake, and the shards' files each is merged from.

    Args:
        names: Metadata files that the shards were written with.
    """
    partitions: dict[str, list[str]] = defaultdict(list)
    for name in sorted(names):
        partitions[name.rpartition("/")[0]].append(name)
    wanted: dict[str, list[str]] = {}
    for folder, members in partitions.items():
        if len(members) <= MAX_METADATA_FILES:
            for name in members:
                wanted[name] = [name]
            continue
        chosen: dict[int, list[str]] = defaultdict(list)
        for name in members:
            chosen[int(_digest(name), 16) % MERGED_FILES].append(name)
        wanted |= {f"{folder}/merged-{_digest(*chosen[k])}.parquet": chosen[k] for k in sorted(chosen)}
    return wanted


def merge(files: LakeFiles, base: Snapshot, names: Iterable[str]) -> tuple[str, ...]:
    """Publish merged metadata files that do not exist yet, and return all metadata files of the lake.

    Args:
        files: The lake's files.
        base: The newest snapshot; its metadata files are used as they are.
        names: Metadata files that the shards were written with.
    """
    wanted = layout(names)
    for name, sources in wanted.items():
        if sources == [name] or (name in base.metadata and not files.renew([name])):
            continue
        try:
            is_finished = files.verify(name)  # by an earlier job
        except LakeError:
            is_finished = False
        if not is_finished or files.renew([name]):
            _merge(files, name, sources)
    return tuple(wanted)


def merge_again(files: LakeFiles, names: Iterable[str]) -> None:
    """Publish damaged merged metadata files of the newest snapshot again, except those whose sources are damaged."""
    base, damaged = snapshots.read(files), set(names)
    wanted = layout(manifests.column(files, base, "metadata_file").drop_null().to_pylist())
    for name in damaged & set(wanted) & set(base.metadata):
        if damaged.isdisjoint(wanted[name]):
            _merge(files, name, wanted[name])


def current_metadata(
    base: Snapshot, existing: Sequence[ShardRecord], removed: frozenset[str], rewritten: Sequence[ShardRecord] = ()
) -> tuple[str, ...]:
    """The snapshot's metadata files after removing some shards and rewriting others.

    Partitions with removed shards fall back to one file per shard.

    Args:
        base: The snapshot.
        existing: Its shards.
        removed: Keys of the removed shards.
        rewritten: New records of the rewritten shards.
    """
    if not removed:
        return base.metadata
    now = {record.key: record for record in existing if record.key not in removed}
    now |= {record.key: record for record in rewritten}
    changed = {name.rpartition("/")[0] for name in shard_files(each for each in existing if each.key in removed)}
    kept = (name for name in base.metadata if name.rpartition("/")[0] not in changed)
    return (*kept, *(name for name in shard_files(now.values()) if name.rpartition("/")[0] in changed))


def _merge(files: LakeFiles, name: str, sources: list[str]) -> None:
    """Publish the concatenation of several metadata files."""
    table = tables.load("metadata")
    together = pa.concat_tables([table.conform(rows) for rows in files.read_all(sources)])
    publish_table(files, "metadata", together, {}, name, row_group_size=_ROWS_PER_GROUP)


def _digest(*names: str) -> str:
    return hashlib.blake2b("\n".join(names).encode(), digest_size=8).hexdigest()
