"""Commits: finished shards become part of the lake, all at once or not at all, whoever else commits meanwhile."""

from __future__ import annotations

import hashlib
import random
import time
from collections import defaultdict
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from pathlib import PurePosixPath

import pyarrow as pa
import pyarrow.compute as pc

from scenarionet_data.errors import SnapshotConflict
from scenarionet_data.store import snapshot as snapshots
from scenarionet_data.store.files import LakeFiles
from scenarionet_data.store.shard_record import ShardRecord
from scenarionet_data.store.snapshot import Snapshot
from scenarionet_data.store.table_file import write_table

MAX_METADATA_FILES = 64
"""Live metadata files of a partition; more are merged (3,000 files of 64 rows take 0.7 s to count)."""

MERGED_FILES = 16
"""Files that a larger partition has instead; one more shard changes one of them."""

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
        removed: Keys of shards they replace. When one of ``added`` is refused, nothing is replaced and nothing is
            committed: what is in the lake goes only together with what takes its place.

    Raises:
        SnapshotConflict: Other jobs published a snapshot before this one, every time.
    """
    wanted = list(added)
    for attempt in range(_ATTEMPTS):
        base = snapshots.read(files)
        present = set(snapshots.column(files, base, "key").to_pylist())
        gone = frozenset(removed & present)
        fresh = [record for record in wanted if record.key not in present - gone]
        kept_metadata = _without(files, base, gone) if gone else base.metadata
        fresh, refused = _refuse_duplicates(files, kept_metadata, fresh)
        if (refused and gone) or not (fresh or gone):
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
    """Give partitions of many shards few metadata files.

    The result is a function of the shards alone, whatever the order of the commits: up to MAX_METADATA_FILES
    shards keep their own files; of more, each stands in the one of MERGED_FILES that its name's hash chooses.
    """
    for _ in range(_ATTEMPTS):
        base = snapshots.read(files)
        wanted = _metadata_files(_own_files(files, base))
        if set(wanted) == set(base.metadata):
            return base
        for name, sources in wanted.items():
            if sources != [name] and not files.has(name):
                _merge(files, name, sources)
        following = replace(
            base,
            number=base.number + 1,
            created_at=snapshots.now(),
            operation="consolidate metadata",
            metadata=tuple(wanted),
        )
        if snapshots.publish(files, following):
            return following
    raise SnapshotConflict(f"{files.root}: another job committed first, {_ATTEMPTS} times; run the command again")


def _own_files(files: LakeFiles, base: Snapshot) -> dict[str, str]:
    """Metadata file of every shard to the version of the contract it was written under."""
    names, schemas = (snapshots.column(files, base, name).to_pylist() for name in ("metadata_file", "schemas"))
    return {name: schema for name, schema in zip(names, schemas, strict=True) if name is not None}


def _metadata_files(own: Mapping[str, str]) -> dict[str, list[str]]:
    """Metadata files that a lake of these shards has, and the shards' own files each is made of."""
    partitions: dict[str, list[str]] = defaultdict(list)
    for name in sorted(own):
        partitions[_folder(name)].append(name)
    wanted: dict[str, list[str]] = {}
    for folder, names in partitions.items():
        # Files of different contracts stay apart until the last of the old ones has been replaced.
        if len(names) <= MAX_METADATA_FILES or len({own[name] for name in names}) > 1:
            wanted |= {name: [name] for name in names}
            continue
        chosen: dict[int, list[str]] = defaultdict(list)
        for name in names:
            chosen[int(_digest(name), 16) % MERGED_FILES].append(name)
        wanted |= {f"{folder}/merged-{_digest(*chosen[k])}.parquet": chosen[k] for k in sorted(chosen)}
    return wanted


def _digest(*names: str) -> str:
    return hashlib.blake2b("\n".join(names).encode(), digest_size=8).hexdigest()


def _merge(files: LakeFiles, name: str, sources: list[str]) -> None:
    """Publish shards' own metadata files, one after the other, as one."""
    together = pa.concat_tables([files.read(source) for source in sources])
    files.publish(write_table(files, "metadata", together, {}, row_group_size=_ROWS_PER_GROUP), name)


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
    columns = [files.read(name, ["scenario_id"])["scenario_id"] for name in names]
    chunks = [chunk for column in columns for chunk in column.chunks]
    return pa.concat_arrays(chunks) if chunks else pa.array([], pa.string())


def _folder(name: str) -> str:
    return str(PurePosixPath(name).parent)


def _release(name: str) -> tuple[str, str]:
    parts = dict(part.split("=", 1) for part in name.split("/") if "=" in part)
    return parts["dataset"], parts["version"]
