"""Commits: add finished shards to the lake atomically, also while other jobs commit."""

from __future__ import annotations

import random
import time
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from operator import attrgetter
from typing import TypeVar
from weakref import WeakKeyDictionary

import pyarrow as pa
import pyarrow.compute as pc

from scenarionet_data.errors import LakeError, SnapshotConflict
from scenarionet_data.storage.files.lake_files import LakeFiles
from scenarionet_data.storage.read.metadata_rows import order_of_ids
from scenarionet_data.storage.snapshots import manifests, metadata_files
from scenarionet_data.storage.snapshots import snapshot as snapshots
from scenarionet_data.storage.snapshots.shard_record import ShardRecord, partition
from scenarionet_data.storage.snapshots.snapshot import Snapshot
from scenarionet_data.storage.write import rewriting
from scenarionet_data.storage.write.layouts import layout_of, unit_of
from scenarionet_data.storage.write.repeated import leave_out
from scenarionet_data.storage.write.table_file import publish_table

_ATTEMPTS = 50

_READ: WeakKeyDictionary[LakeFiles, dict[str, pa.Array]] = WeakKeyDictionary()
"""Scenario ids by metadata file, for each lake that this process commits to."""

_KEY = attrgetter("key")

Outcome = TypeVar("Outcome")

Refused = tuple[tuple[ShardRecord, str], ...]
Reduced = tuple[tuple[ShardRecord, ShardRecord], ...]


@dataclass(frozen=True)
class Committed:
    """Result of a commit.

    Attributes:
        snapshot: The snapshot that holds the shards.
        refused: Shards that repeat a scenario id already in the lake: record, scenario id. Only shards that replace
            others are refused as a whole: a scenario left out might be one that moves between shards still to come.
        reduced: Shards committed without the scenarios whose ids the lake has already: as finished, as committed.
    """

    snapshot: Snapshot
    refused: Refused = ()
    reduced: Reduced = ()


@dataclass(frozen=True)
class Rewritten:
    """Shards that were rewritten together.

    Attributes:
        old: Their records before.
        new: Their records after, in the same order.
    """

    old: tuple[ShardRecord, ...]
    new: tuple[ShardRecord, ...]


def commit(
    files: LakeFiles, added: Iterable[ShardRecord], operation: str, removed: frozenset[str] = frozenset()
) -> Committed:
    """Publish a snapshot with finished shards added and others removed.

    Scenarios whose ids the lake has already are left out, and listed in their shard's quarantine.

    Args:
        files: The lake's files.
        added: Finished shards; those already in the lake are skipped.
        operation: Description for the snapshot.
        removed: Keys of the shards they replace. When one of ``added`` is refused, nothing is committed, so that no
            shard is removed without its replacement.

    Raises:
        SnapshotConflict: Other jobs published a snapshot first, on every attempt.
        LakeError: Files of ``added`` are missing.
    """
    wanted = list(added)

    def change(base: Snapshot) -> tuple[Snapshot | None, tuple[Refused, Reduced]]:
        present = set(manifests.column(files, base, "key").to_pylist())
        replaced = frozenset(removed & present)
        fresh = [record for record in wanted if record.key not in present or record.key in replaced]
        _renew(files, fresh)
        existing = manifests.shards(files, base) if replaced else []
        remaining = metadata_files.current_metadata(base, existing, replaced)
        accepted, refused, reduced = list[ShardRecord](), list[tuple[ShardRecord, str]](), []
        for record, repeated in zip(fresh, _repeated(files, remaining, fresh), strict=True):
            if repeated and replaced:
                refused.append((record, next(iter(repeated))))
                continue
            accepted.append(leave_out(files, record, repeated) if repeated else record)
            if repeated:
                reduced.append((record, accepted[-1]))
        outcome = tuple(refused), tuple(reduced)
        if refused or not (accepted or replaced):
            return None, outcome
        rewritten = _rewrite_neighbours(files, existing, replaced) if replaced else []
        following = Snapshot(
            number=base.number + 1,
            created_at=snapshots.now(),
            operation=operation,
            metadata=(
                *metadata_files.current_metadata(base, existing, replaced, rewritten),
                *metadata_files.shard_files(accepted),
            ),
            manifests=manifests.write(files, base, [*accepted, *rewritten], replaced.union(map(_KEY, rewritten))),
        )
        return following, outcome

    snapshot, (refused, reduced) = _publish(files, change)
    return Committed(snapshot, refused, reduced)


def replace_files(files: LakeFiles, rewritten: Sequence[Rewritten], operation: str) -> tuple[Snapshot, list[Rewritten]]:
    """Publish a snapshot in which rewritten shards point to their new files.

    Returns:
        The snapshot, and the entries left out because another job has replaced or rewritten one of their shards.

    Raises:
        SnapshotConflict: Other jobs published a snapshot first, on every attempt.
    """

    def change(base: Snapshot) -> tuple[Snapshot | None, list[Rewritten]]:
        existing = manifests.shards(files, base)
        current = {record.key: record.metadata_file for record in existing}
        ready = [each for each in rewritten if all(current.get(old.key) == old.metadata_file for old in each.old)]
        new = {record.key: record for each in ready for record in each.new}
        late = [each for each in rewritten if each not in ready]
        if not new:
            return None, late
        _renew(files, new.values())
        now = [new.get(record.key, record) for record in existing]
        following = Snapshot(
            number=base.number + 1,
            created_at=snapshots.now(),
            operation=operation,
            metadata=metadata_files.merge(files, base, metadata_files.shard_files(now)),
            manifests=manifests.write(files, base, new.values(), frozenset(new)),
        )
        return following, late

    snapshot, late = _publish(files, change)
    return _with_order(files, snapshot), late


def consolidate(files: LakeFiles) -> Snapshot:
    """Merge the metadata files of partitions with many shards; see :mod:`.metadata_files`."""

    def change(base: Snapshot) -> tuple[Snapshot | None, None]:
        names = manifests.column(files, base, "metadata_file").drop_null().to_pylist()
        if set(metadata_files.layout(names)) == set(base.metadata):
            return None, None
        following = replace(
            base,
            number=base.number + 1,
            created_at=snapshots.now(),
            operation="consolidate metadata",
            metadata=metadata_files.merge(files, base, names),
        )
        return following, None

    return _with_order(files, _publish(files, change)[0])


def _with_order(files: LakeFiles, snapshot: Snapshot) -> Snapshot:
    """Publish the order of the ids of a lake with many scenarios; without it, each loader has to sort them."""
    count = manifests.column(files, snapshot, "num_scenarios").to_numpy().sum()
    if count >= snapshots.MANY and not files.has(name := snapshots.order_file(snapshot.metadata)):
        publish_table(files, "id_order", pa.table({"row": order_of_ids(files, snapshot.metadata)}), {}, name)
    return snapshot


def _publish(
    files: LakeFiles, change: Callable[[Snapshot], tuple[Snapshot | None, Outcome]]
) -> tuple[Snapshot, Outcome]:
    """Apply a change to the newest snapshot and publish the result; retry when another job publishes first.

    Args:
        files: The lake's files.
        change: Returns the following snapshot (None if nothing changes) and a further result for the caller.
    """
    for attempt in range(_ATTEMPTS):
        base = snapshots.read(files)
        try:
            following, outcome = change(base)
        except LakeError:
            if snapshots.read(files).number == base.number:
                raise
            continue  # another job has published, and a vacuum has removed files of the base
        if following is None:
            return base, outcome
        if snapshots.publish(files, following):
            return following, outcome
        time.sleep(random.uniform(0, 0.02 * (attempt + 1)))  # noqa: S311  # back-off between competing jobs
    raise SnapshotConflict(
        f"{files.root}: another job committed first, {_ATTEMPTS} times; run the same command again, no work is lost"
    )


def _rewrite_neighbours(
    files: LakeFiles, existing: Sequence[ShardRecord], removed: frozenset[str]
) -> list[ShardRecord]:
    """Rewrite the shards that share files with removed shards, so that no file keeps superseded rows."""
    units = {unit_of(record): layout_of(record) for record in existing if record.key in removed}
    left = [record for record in existing if record.key not in removed and unit_of(record) in units]
    rewritten: list[ShardRecord] = []
    for unit, layout in units.items():
        together = [record for record in left if unit_of(record) == unit]
        rewritten += rewriting.rewrite(files, together, layout) if together else []
    return rewritten


def _renew(files: LakeFiles, records: Iterable[ShardRecord]) -> None:
    """Renew the files of shards that are about to be committed, which protects them from ``vacuum``.

    Raises:
        LakeError: A vacuum has already removed them.
    """
    for record in records:
        missing = files.renew([*metadata_files.shard_files([record]), *record.files])
        if missing:
            raise LakeError(
                f"{files.url(missing[0])}: gone, although shard {record.name} was finished; "
                "`scenarionet maintain vacuum` removes uncommitted files after a day: run the same "
                "command again to create them"
            )


def _repeated(files: LakeFiles, remaining: tuple[str, ...], fresh: list[ShardRecord]) -> list[dict[str, str]]:
    """Ids in each shard that the lake or an earlier one of the shards has already, and where."""
    if not fresh:
        return []
    ids = [_ids(files, metadata_files.shard_files([record])) for record in fresh]
    wanted, taken = pa.concat_arrays(ids), dict[str, str]()
    releases = tuple({f"{partition('metadata', record.dataset, record.version, '')}/" for record in fresh})
    rivals = [name for name in remaining if name.startswith(releases)]
    if pc.any(pc.is_in(_ids(files, rivals), value_set=wanted)).as_py():
        for rows in files.read_all(rivals, ["scenario_id", "split", "source_file", "tracks_file"]):
            for row in rows.filter(pc.is_in(rows["scenario_id"], value_set=wanted)).to_pylist():
                place = f"split {row['split']}, recording {row['source_file']} ({row['tracks_file']})"
                taken[row["scenario_id"]] = place
    repeated = list[dict[str, str]]()
    for record, own in zip(fresh, ids, strict=True):
        repeated.append({})
        for identifier in own.to_pylist():
            place = taken.setdefault(identifier, here := f"split {record.split}, shard {record.name}")
            if place is not here:
                repeated[-1][identifier] = place
    return repeated


def _ids(files: LakeFiles, names: list[str]) -> pa.Array:
    """Scenario ids in metadata files; each file is read once per process, because it never changes."""
    known = _READ.setdefault(files, {})
    missing = [name for name in names if name not in known]
    for name, rows in zip(missing, files.read_all(missing, ["scenario_id"]), strict=True):
        known[name] = rows["scenario_id"].combine_chunks()
    return pa.concat_arrays([pa.array([], pa.string()), *map(known.__getitem__, names)])
