"""What fsck asks of what belongs to no snapshot: databases, users' columns, results of the simulator."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping

import pyarrow as pa

from scenarionet_data.databases import record as databases
from scenarionet_data.databases.record import DatabaseRecord
from scenarionet_data.errors import LakeError
from scenarionet_data.schema import tables
from scenarionet_data.storage import evaluation_runs
from scenarionet_data.storage.files.lake_files import LakeFiles
from scenarionet_data.storage.snapshots.snapshot import Snapshot
from scenarionet_data.storage.verifying import Damage, unreadable

_MEMBER = ["scenario_id", "content_hash"]


def damages(files: LakeFiles, there: Mapping[int, Snapshot], broken: Iterable[str]) -> Iterator[Damage]:
    """What is wrong with them.

    Args:
        files: The lake.
        there: Its snapshots that can be read, by number.
        broken: Files that are known to be damaged; what needs them is not asked.
    """
    yield from _database_damages(files, _Contents(files, there, set(broken)))
    for layer in files.folders("layers"):
        for name in files.names(f"layers/{layer}", ".parquet"):
            yield from unreadable(files, name)
    for run in evaluation_runs.names(files):
        yield from _run_damages(files, run)


class _Contents:
    """Which scenarios snapshots hold."""

    def __init__(self, files: LakeFiles, there: Mapping[int, Snapshot], broken: set[str]) -> None:
        self.newest = max(there, default=0)
        self._files = files
        self._there = there
        self._broken = broken
        self._kept: dict[int, pa.Table | None] = {}

    def lost(self, database: DatabaseRecord, number: int) -> int | None:
        """Members that a snapshot does not hold as they were; None when it cannot tell."""
        if number not in self._kept:
            self._kept[number] = self._read(number)
        held = self._kept[number]
        return None if held is None else database.members.join(held, _MEMBER, join_type="left anti").num_rows

    def has(self, number: int) -> bool:
        """Whether there is such a snapshot."""
        return number in self._there

    def _read(self, number: int) -> pa.Table | None:
        names = self._there[number].metadata if number in self._there else ()
        if number not in self._there or self._broken.intersection(names):
            return None
        empty = tables.load("metadata").schema.empty_table().select(_MEMBER)
        return pa.concat_tables([empty, *(self._files.read(name, _MEMBER) for name in names)])


def bases(files: LakeFiles) -> set[int]:
    """Snapshots that databases were made on, as far as they say so."""
    return {found.lineage.snapshot for _, found in _each_database(files) if not isinstance(found, str)}


def _each_database(files: LakeFiles) -> Iterator[tuple[str, DatabaseRecord | str]]:
    """Every version of every database: its file, and itself or why it cannot be read."""
    for name in databases.names(files):
        for version in databases.versions(files, name):
            try:
                yield databases.path(name, version), databases.read(files, name, version)
            except (LakeError, ValueError, KeyError, TypeError) as error:
                yield databases.path(name, version), f"cannot be read: {error}"


def _database_damages(files: LakeFiles, contents: _Contents) -> Iterator[Damage]:
    for file, found in _each_database(files):
        if isinstance(found, str):
            yield Damage(file, found)
            continue
        damages = list(unreadable(files, file))
        yield from damages or (Damage(file, reason) for reason in _complaints(files, found, contents))


def _complaints(files: LakeFiles, found: DatabaseRecord, contents: _Contents) -> Iterator[str]:
    """What is wrong with a database that can be read."""
    made_on, count = found.lineage.snapshot, found.members.num_rows
    if count != found.lineage.count:
        yield f"{count:,} members, was written with {found.lineage.count:,}"
    if contents.lost(found, contents.newest):  # then it is read from the snapshot it was made on
        lost = contents.lost(found, made_on)
        if not contents.has(made_on):
            yield f"members have changed, and snapshot {made_on}, which it was made on, is gone"
        elif lost:
            yield f"{lost:,} of {count:,} members are not in snapshot {made_on}, which it was made on"
    for reference in found.lineage.user_columns:
        layer, _, version = reference.partition("@")
        if not files.has(f"layers/{layer}/{version}.parquet"):
            yield f"it was made with the column {reference}, which is gone"


def _run_damages(files: LakeFiles, run: str) -> Iterator[Damage]:
    try:
        evaluation_runs.describe(files, run)
    except (LakeError, OSError, ValueError) as error:
        yield Damage(f"results/{run}/run.json", f"cannot be read: {error}")
    for table in files.folders(f"results/{run}"):
        for name in files.names(f"results/{run}/{table}", ".parquet"):
            try:
                files.footer(name)
            except LakeError as error:
                yield Damage(name, str(error))
