"""fsck of everything outside snapshots: databases, user columns, evaluation results."""

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


def damages(files: LakeFiles, readable: Mapping[int, Snapshot], broken: Iterable[str]) -> Iterator[Damage]:
    """Find damaged databases, user columns and evaluation results.

    Args:
        files: The lake.
        readable: Its readable snapshots by number.
        broken: Files known to be damaged; checks that need them are skipped.
    """
    yield from _database_damages(files, _Contents(files, readable, set(broken)))
    for layer in files.folders("layers"):
        for name in files.names(f"layers/{layer}", ".parquet"):
            yield from unreadable(files, name)
    for run in evaluation_runs.names(files):
        yield from _run_damages(files, run)


class _Contents:
    """Scenarios of snapshots."""

    def __init__(self, files: LakeFiles, readable: Mapping[int, Snapshot], broken: set[str]) -> None:
        self.newest = max(readable, default=0)
        self._files = files
        self._readable = readable
        self._broken = broken
        self._cache: dict[int, pa.Table | None] = {}

    def lost(self, database: DatabaseRecord, number: int) -> int | None:
        """Number of members missing or changed in a snapshot; None if the snapshot is damaged."""
        if number not in self._cache:
            self._cache[number] = self._read(number)
        scenarios = self._cache[number]
        return None if scenarios is None else database.members.join(scenarios, _MEMBER, join_type="left anti").num_rows

    def has(self, number: int) -> bool:
        """Whether the snapshot is readable."""
        return number in self._readable

    def _read(self, number: int) -> pa.Table | None:
        names = self._readable[number].metadata if number in self._readable else ()
        if number not in self._readable or self._broken.intersection(names):
            return None
        empty = tables.load("metadata").schema.empty_table().select(_MEMBER)
        return pa.concat_tables([empty, *(self._files.read(name, _MEMBER) for name in names)])


def bases(files: LakeFiles) -> set[int]:
    """Snapshots that readable databases were made on."""
    return {found.lineage.snapshot for _, found in _each_database(files) if not isinstance(found, str)}


def _each_database(files: LakeFiles) -> Iterator[tuple[str, DatabaseRecord | str]]:
    """Yield every version of every database: its file, and the database or the reason why it cannot be read."""
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
        yield from damages or (Damage(file, reason) for reason in _problems(files, found, contents))


def _problems(files: LakeFiles, found: DatabaseRecord, contents: _Contents) -> Iterator[str]:
    """Yield the problems of a readable database."""
    made_on, count = found.lineage.snapshot, found.members.num_rows
    if count != found.lineage.count:
        yield f"{count:,} members, was written with {found.lineage.count:,}"
    if contents.lost(found, contents.newest):  # such a database is read from the snapshot it was made on
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
