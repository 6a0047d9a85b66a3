"""Commits: finished shards become part of the lake, all at once or not at all, whoever else commits meanwhile."""

from __future__ import annotations

import random
import time
from collections import defaultdict
from collections.abc import Iterable
from dataclasses import dataclass, replace
from pathlib import PurePosixPath

import pyarrow as pa
import pyarrow.compute as pc
import pyarrow.parquet as pq

from scenarionet_data import tables
from scenarionet_data.errors import SnapshotConflict
from scenarionet_data.store import snapshot as snapshots
from scenarionet_data.store.files import LakeFiles, sha256, writing
from scenarionet_data.store.shard_writer import ShardRecord
from scenarionet_data.store.snapshot import Snapshot

MAX_METADATA_FILES = 64
"""Live metadata files of a partition; more are merged (3,000 files of 64 rows take 0.7 s to count)."""

ROWS_PER_METADATA_FILE = 262_144
_ROWS_PER_GROUP = 65_536
_ATTEMPTS = 50


@dataclass(frozen=True)
class Committed:
    """What became of a commit.

    Attributes:
        snapshot: The snapshot that holds the shards.
        refused: Shards left out, because a scenario of theirs is in the lake already: record, scenario id.
    """

    snapshot: Snapshot
    refused: tuple[tuple[ShardRecord, str], ...] = ()


def commit(
    files: LakeFiles, added: Iterable[ShardRecord], operation: str, removed: frozenset[str] = frozenset()
) -> Committed:
    """Add finished shards to the lake and take shards away, as one new snapshot.

    Args:
        files: The lake.
        added: Finished shards; those the lake holds already are skipped.
        operation: What made them, in words.
        removed: Keys of shards they replace.

    Raises:
        SnapshotConflict: Other jobs published a snapshot before this one, every time.
    """
    wanted = list(added)
    for attempt in range(_ATTEMPTS):
        base = snapshots.read(files)
        present = set(snapshots.shard_table(files, base)["key"].to_pylist())
        gone = frozenset(removed & present)
        fresh = [record for record in wanted if record.key not in present - gone]
        kept_metadata = _without(files, base, gone) if gone else base.metadata
        fresh, refused = _refuse_duplicates(files, kept_metadata, fresh)
        if not fresh and not gone:
            return Committed(base, refused)
        following = Snapshot(
            number=base.number + 1,
            created_at=snapshots.now(),
            operation=operation,
            metadata=(*kept_metadata, *_own_metadata(fresh)),
            manifests=snapshots.write_manifests(files, base, fresh, gone),
        )
        if snapshots.publish(files, following):
            return Committed(following, refused)
        time.sleep(random.uniform(0, 0.02 * (attempt + 1)))  # noqa: S311  # spreads rivals, hides nothing
    raise SnapshotConflict(
        f"{files.root}: {_ATTEMPTS} times another job committed first; run the same command again, nothing is lost"
    )


def consolidate(files: LakeFiles) -> Snapshot:
    """Merge the metadata files of every partition that has too many.

    The result is a function of the partition's shards alone: their metadata files one after the other, by
    name, cut at a fixed number of rows.
    """
    for _ in range(_ATTEMPTS):
        base = snapshots.read(files)
        live = _by_partition(base.metadata)
        crowded = {folder for folder, names in live.items() if len(names) > MAX_METADATA_FILES}
        if not crowded:
            return base
        sources = sorted(_own_metadata(snapshots.shards(files, base)))
        merged = [name for folder in sorted(crowded) for name in _merge(files, folder, sources)]
        kept = [name for name in base.metadata if _folder(name) not in crowded]
        following = replace(
            base,
            number=base.number + 1,
            created_at=snapshots.now(),
            operation="consolidate metadata",
            metadata=(*kept, *merged),
        )
        if snapshots.publish(files, following):
            return following
    raise SnapshotConflict(f"{files.root}: another job committed first, {_ATTEMPTS} times; run the command again")


def _merge(files: LakeFiles, folder: str, sources: list[str]) -> list[str]:
    """Concatenate the shards' own metadata files of a partition into few; returns the new files' names."""
    declared = tables.load("metadata")
    names: list[str] = []
    batch: list[pa.Table] = []
    rows = 0
    mine = [name for name in sources if _folder(name) == folder]
    for position, name in enumerate(mine):
        batch.append(pq.ParquetFile(files.path(name)).read())
        rows += batch[-1].num_rows
        if rows >= ROWS_PER_METADATA_FILE or position == len(mine) - 1:
            temporary = files.temporary()
            with writing(temporary), declared.writer(temporary, {}) as writer:
                writer.write_table(pa.concat_tables(batch).cast(declared.schema), row_group_size=_ROWS_PER_GROUP)
            merged = f"{folder}/merged-{sha256(temporary)[:16]}.parquet"
            files.publish(temporary, merged)
            names.append(merged)
            batch, rows = [], 0
    return names


def _without(files: LakeFiles, base: Snapshot, gone: frozenset[str]) -> tuple[str, ...]:
    """Live metadata files without the rows of some shards; their partitions fall back to the shards' own files."""
    records = snapshots.shards(files, base)
    touched = {_folder(name) for name in _own_metadata(record for record in records if record.key in gone)}
    kept = [name for name in base.metadata if _folder(name) not in touched]
    own = _own_metadata(record for record in records if record.key not in gone)
    return (*kept, *(name for name in own if _folder(name) in touched))


def _refuse_duplicates(
    files: LakeFiles, live: tuple[str, ...], fresh: list[ShardRecord]
) -> tuple[list[ShardRecord], tuple[tuple[ShardRecord, str], ...]]:
    """Parts the shards into those whose ids are new to the lake and those with an id it holds."""
    if not fresh:
        return [], ()
    releases = {(record.dataset, record.version) for record in fresh}
    rivals = [name for name in live if _release(name) in releases]
    taken = _ids(files, rivals)
    accepted, refused = [], []
    seen: set[str] = set()
    for record in fresh:
        ids = _ids(files, _own_metadata([record]))
        again = ids.filter(pc.is_in(ids, value_set=taken)).to_pylist()
        again += [identifier for identifier in ids.to_pylist() if identifier in seen]
        if again:
            refused.append((record, str(again[0])))
        else:
            accepted.append(record)
            seen.update(ids.to_pylist())
    return accepted, tuple(refused)


def _own_metadata(records: Iterable[ShardRecord]) -> list[str]:
    """The shards' own metadata files; a shared map has none."""
    return [record.metadata_file for record in records if record.metadata_file is not None]


def _ids(files: LakeFiles, names: list[str]) -> pa.Array:
    columns = [pq.ParquetFile(files.path(name)).read(columns=["scenario_id"])["scenario_id"] for name in names]
    chunks = [chunk for column in columns for chunk in column.chunks]
    return pa.concat_arrays(chunks) if chunks else pa.array([], pa.string())


def _folder(name: str) -> str:
    return str(PurePosixPath(name).parent)


def _release(name: str) -> tuple[str, str]:
    parts = dict(part.split("=", 1) for part in name.split("/") if "=" in part)
    return parts["dataset"], parts["version"]


def _by_partition(names: Iterable[str]) -> dict[str, list[str]]:
    found: dict[str, list[str]] = defaultdict(list)
    for name in names:
        found[_folder(name)].append(name)
    return found
