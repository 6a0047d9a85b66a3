"""Commits: finished shards become part of the lake, all at once or not at all, whoever else commits meanwhile."""

from __future__ import annotations

import random
import time
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from typing import TypeVar
from weakref import WeakKeyDictionary

import pyarrow as pa
import pyarrow.compute as pc

from scenarionet_data.errors import LakeError, SnapshotConflict
from scenarionet_data.storage.files.lake_files import LakeFiles
from scenarionet_data.storage.snapshots import manifests, metadata_files
from scenarionet_data.storage.snapshots import snapshot as snapshots
from scenarionet_data.storage.snapshots.shard_record import ShardRecord
from scenarionet_data.storage.snapshots.snapshot import Snapshot
from scenarionet_data.storage.write import rewriting
from scenarionet_data.storage.write.layouts import layout_of, unit_of

_ATTEMPTS = 50

_READ: WeakKeyDictionary[LakeFiles, dict[str, pa.Array]] = WeakKeyDictionary()
"""Scenario ids by metadata file, of every lake that this process commits to."""

Told = TypeVar("Told")


@dataclass(frozen=True)
class Committed:
    """What became of a commit.

    Attributes:
        snapshot: The snapshot that holds the shards.
        refused: Shards left out, because a scenario of theirs is in the lake already: record, scenario id.
    """

    snapshot: Snapshot
    refused: tuple[tuple[ShardRecord, str], ...] = ()


@dataclass(frozen=True)
class Rewritten:
    """Shards that were written together, in other files than before.

    Attributes:
        old: Their records as they were.
        new: Their records now, in the same order.
    """

    old: tuple[ShardRecord, ...]
    new: tuple[ShardRecord, ...]


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
        LakeError: Files of ``added`` are gone.
    """
    wanted = list(added)

    def change(base: Snapshot) -> tuple[Snapshot | None, tuple[tuple[ShardRecord, str], ...]]:
        present = set(manifests.column(files, base, "key").to_pylist())
        gone = frozenset(removed & present)
        fresh = [record for record in wanted if record.key not in present - gone]
        _keep(files, fresh)
        held = manifests.shards(files, base) if gone else []
        fresh, refused = _refuse_duplicates(files, metadata_files.live(base, held, gone), fresh)
        if (refused and gone) or not (fresh or gone):
            return None, refused
        moved = _separate(files, held, gone)
        following = Snapshot(
            number=base.number + 1,
            created_at=snapshots.now(),
            operation=operation,
            metadata=(*metadata_files.live(base, held, gone, moved), *metadata_files.own(fresh)),
            manifests=manifests.write(files, base, [*fresh, *moved], gone | {one.key for one in moved}),
        )
        return following, refused

    return Committed(*_publish(files, change))


def swap(files: LakeFiles, rewritten: Sequence[Rewritten], operation: str) -> tuple[Snapshot, list[Rewritten]]:
    """Let shards lie in other files, as one new snapshot with few metadata files.

    Returns:
        The snapshot, and what was left out: another job has replaced or rewritten one of its shards meanwhile.

    Raises:
        SnapshotConflict: Other jobs published a snapshot before this one, every time.
    """

    def change(base: Snapshot) -> tuple[Snapshot | None, list[Rewritten]]:
        held = manifests.shards(files, base)
        there = {record.key: record.metadata_file for record in held}
        ready = [each for each in rewritten if all(there.get(old.key) == old.metadata_file for old in each.old)]
        moved = {record.key: record for each in ready for record in each.new}
        late = [each for each in rewritten if each not in ready]
        if not moved:
            return None, late
        _keep(files, moved.values())
        now = [moved.get(record.key, record) for record in held]
        schemas = {record.metadata_file: record.schemas for record in now if record.metadata_file is not None}
        following = Snapshot(
            number=base.number + 1,
            created_at=snapshots.now(),
            operation=operation,
            metadata=metadata_files.merge(files, schemas),
            manifests=manifests.write(files, base, moved.values(), frozenset(moved)),
        )
        return following, late

    return _publish(files, change)


def consolidate(files: LakeFiles) -> Snapshot:
    """Give partitions of many shards few metadata files; see :mod:`.metadata_files`."""

    def change(base: Snapshot) -> tuple[Snapshot | None, None]:
        schemas = metadata_files.own_with_schemas(files, base)
        if set(metadata_files.layout(schemas)) == set(base.metadata):
            return None, None
        following = replace(
            base,
            number=base.number + 1,
            created_at=snapshots.now(),
            operation="consolidate metadata",
            metadata=metadata_files.merge(files, schemas),
        )
        return following, None

    return _publish(files, change)[0]


def _publish(files: LakeFiles, change: Callable[[Snapshot], tuple[Snapshot | None, Told]]) -> tuple[Snapshot, Told]:
    """Publish what a change makes of the newest snapshot, again for as long as others publish first.

    Args:
        files: The lake.
        change: The following snapshot, or None when there is nothing to change; and what to tell.
    """
    for attempt in range(_ATTEMPTS):
        base = snapshots.read(files)
        try:
            following, told = change(base)
        except LakeError:
            if snapshots.read(files).number == base.number:
                raise
            continue  # others have moved on and a vacuum has taken files of the base
        if following is None:
            return base, told
        if snapshots.publish(files, following):
            return following, told
        time.sleep(random.uniform(0, 0.02 * (attempt + 1)))  # noqa: S311  # spreads rivals, hides nothing
    raise SnapshotConflict(
        f"{files.root}: {_ATTEMPTS} times another job committed first; run the same command again, nothing is lost"
    )


def _separate(files: LakeFiles, held: Sequence[ShardRecord], gone: frozenset[str]) -> list[ShardRecord]:
    """Shards that share files with those that go, written anew: a file of the lake holds no row that is superseded."""
    units = {unit_of(record): layout_of(record) for record in held if record.key in gone}
    left = [record for record in held if record.key not in gone and unit_of(record) in units]
    moved: list[ShardRecord] = []
    for unit, profile in units.items():
        together = [record for record in left if unit_of(record) == unit]
        moved += rewriting.rewrite(files, together, profile) if together else []
    return moved


def _keep(files: LakeFiles, records: Iterable[ShardRecord]) -> None:
    """Renew the files of shards that are about to be committed, so that no ``vacuum`` takes them.

    Raises:
        LakeError: One has taken them already.
    """
    for record in records:
        gone = files.renew([*metadata_files.own([record]), *record.files])
        if gone:
            raise LakeError(
                f"{files.url(gone[0])}: gone, although shard {record.name} was finished; `scenarionet vacuum` takes "
                "what is not committed after a day: run the same command again, it makes what is missing"
            )


def _refuse_duplicates(
    files: LakeFiles, live: tuple[str, ...], fresh: list[ShardRecord]
) -> tuple[list[ShardRecord], tuple[tuple[ShardRecord, str], ...]]:
    """Parts the shards into those whose ids are new to the lake and those with an id it holds."""
    if not fresh:
        return [], ()
    releases = {(record.dataset, record.version) for record in fresh}
    ids = [_ids(files, metadata_files.own([record])) for record in fresh]
    wanted = pa.concat_arrays(ids)
    rivals = _ids(files, [name for name in live if _release(name) in releases])
    taken = set(rivals.filter(pc.is_in(rivals, value_set=wanted)).to_pylist())
    accepted, refused = [], []
    for record, own in zip(fresh, map(pa.Array.to_pylist, ids), strict=True):
        again = next((identifier for identifier in own if identifier in taken), None)
        if again is None:
            accepted.append(record)
            taken.update(own)
        else:
            refused.append((record, str(again)))
    return accepted, tuple(refused)


def _ids(files: LakeFiles, names: list[str]) -> pa.Array:
    """Scenario ids in metadata files; each is read once for all commits of a job, for it never changes."""
    known = _READ.setdefault(files, {})
    missing = [name for name in names if name not in known]
    for name, rows in zip(missing, files.read_all(missing, ["scenario_id"]), strict=True):
        known[name] = rows["scenario_id"].combine_chunks()
    return pa.concat_arrays([known[name] for name in names]) if names else pa.array([], pa.string())


def _release(name: str) -> tuple[str, str]:
    parts = dict(part.split("=", 1) for part in name.split("/") if "=" in part)
    return parts["dataset"], parts["version"]
