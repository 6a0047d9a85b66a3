"""fsck of databases and user columns."""

from __future__ import annotations

import json
from collections import defaultdict
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import pyarrow as pa

from scenarionet_data.databases import pack_origins
from scenarionet_data.databases import record as records
from scenarionet_data.databases.record import DatabaseRecord, Lineage
from scenarionet_data.errors import LakeError
from scenarionet_data.maintenance.findings import Findings
from scenarionet_data.schema import tables
from scenarionet_data.storage.files.lake_files import LakeFiles
from scenarionet_data.storage.integrity.file_checks import Damage, Written, check_file
from scenarionet_data.storage.read.metadata_rows import first_rows
from scenarionet_data.storage.snapshots.snapshot import Snapshot

_MEMBER = ["scenario_id", "content_hash"]
_MAX_WAITING = 1_000_000
"""Members that are compared with a snapshot at once; a comparison costs as much for one as for many."""


@dataclass
class StoredDatabase:
    """A readable version of a database.

    Attributes:
        file: Its file.
        lineage: How it was made.
        count: Members in the file.
        num_changed: Members missing or changed in the newest snapshot.
    """

    file: str
    lineage: Lineage
    count: int
    num_changed: int = 0


def read_all(
    files: LakeFiles, readable: Mapping[int, Snapshot], found: Findings, *, is_deep: bool
) -> list[StoredDatabase]:
    """Check the files of all databases and user columns; return the readable databases.

    Args:
        files: The lake.
        readable: Its readable snapshots by number.
        found: What has been found so far; comparisons that need damaged files are left out.
        is_deep: Whether to verify every byte.
    """
    for file in _versions(files, "layers", found):
        with found.of(file):
            intact = check_file(files, file, Written(), table=None, is_deep=is_deep)
            column = json.loads(intact.footer[b"scenarionet.layer"])
            if f"layers/{column['name']}/{column['version']}.parquet" != file:
                raise LakeError(f"holds the column {column['name']}@{column['version']}")
            found.saw(file, is_older=intact.is_older)
    stored: dict[str, StoredDatabase] = {}
    newest = _Scenarios(files, readable, max(readable, default=0), found)
    batch = _Batch(newest)
    for file in _versions(files, "databases", found):
        with found.of(file):
            if is_deep:
                files.verify(file)
            database = _record(files, file)
            rows = database.rows
            if rows is not None and {*rows.metadata} <= {*newest.names}:
                if first_rows(files, rows.metadata).tolist() != rows.starts.tolist():
                    raise LakeError("the metadata files that its members are rows of have other numbers of rows")
                count = len(rows)
            else:
                members = database.members.select(_MEMBER)
                count = members.num_rows
                batch.add(file, members)
            stored[file] = StoredDatabase(file, database.lineage, count)
            found.saw(file, is_older=not files.end(file).digest)
    for file, count in batch.lost().items():
        stored[file].num_changed = count
    return list(stored.values())


def check(
    files: LakeFiles, stored: Iterable[StoredDatabase], readable: Mapping[int, Snapshot], found: Findings
) -> None:
    """Compare databases with their lineage and with the snapshots that hold their members.

    Args:
        files: The lake.
        stored: Its readable databases.
        readable: Its readable snapshots by number.
        found: What has been found so far; comparisons that need damaged files are left out.
    """
    made_on: dict[int, list[StoredDatabase]] = defaultdict(list)
    for each in stored:
        found.damages += (Damage(each.file, reason) for reason in _contradictions(files, each))
        if each.num_changed:  # such a database is read from the snapshot it was made on
            made_on[each.lineage.snapshot].append(each)
    for number, group in made_on.items():
        if number not in readable:
            reason = f"members have changed, and snapshot {number}, which it was made on, is gone"
            found.damages += (Damage(each.file, reason) for each in group)
            continue
        batch = _Batch(_Scenarios(files, readable, number, found))
        for each in group:
            batch.add(each.file, _record(files, each.file).members.select(_MEMBER))
        lost = batch.lost()
        found.damages += (
            Damage(
                each.file,
                f"{lost[each.file]:,} of {each.count:,} members are not in snapshot {number}, which it was made on",
            )
            for each in group
            if each.file in lost
        )
    with found.of(pack_origins.FILE):
        if files.has(pack_origins.FILE):
            found.saw(pack_origins.FILE, is_older=not pack_origins.parse(files)[1])


class _Scenarios:
    """Scenarios of a snapshot."""

    def __init__(self, files: LakeFiles, readable: Mapping[int, Snapshot], number: int, found: Findings) -> None:
        self._files = files
        self.names = readable[number].metadata if number in readable else ()
        self._is_damaged = not found.broken.isdisjoint(self.names)

    @cached_property
    def rows(self) -> pa.Table | None:
        """Ids and content hashes; None if the snapshot is damaged."""
        if self._is_damaged:
            return None
        empty = tables.load("metadata").schema.empty_table().select(_MEMBER)
        return pa.concat_tables([empty, *self._files.read_all(self.names, _MEMBER)])


class _Batch:
    """Compares members of many databases with a snapshot, many at once.

    Args:
        scenarios: The snapshot.
    """

    def __init__(self, scenarios: _Scenarios) -> None:
        self._scenarios = scenarios
        self._lost: dict[str, int] = {}
        self._waiting: list[tuple[str, pa.Table]] = []
        self._num_waiting = 0

    def add(self, file: str, members: pa.Table) -> None:
        """Add the members of a database."""
        self._waiting.append((file, members.replace_schema_metadata(None)))
        self._num_waiting += members.num_rows
        if self._num_waiting > _MAX_WAITING:
            self._compare()

    def lost(self) -> dict[str, int]:
        """Number of members missing or changed in the snapshot, for each database that has any."""
        self._compare()
        return self._lost

    def _compare(self) -> None:
        waiting, self._waiting, self._num_waiting = self._waiting, [], 0
        if not waiting or self._scenarios.rows is None:
            return
        numbers = np.repeat(np.arange(len(waiting), dtype=np.int32), [rows.num_rows for _, rows in waiting])
        members = pa.concat_tables([rows for _, rows in waiting]).append_column("database", pa.array(numbers))
        missing = members.join(self._scenarios.rows, _MEMBER, join_type="left anti")["database"].to_numpy()
        counts = np.bincount(missing, minlength=len(waiting))
        self._lost |= {waiting[k][0]: int(counts[k]) for k in np.flatnonzero(counts)}


def _contradictions(files: LakeFiles, stored: StoredDatabase) -> Iterator[str]:
    """Yield contradictions between a database and its lineage."""
    if stored.count != stored.lineage.count:
        yield f"{stored.count:,} members, was written with {stored.lineage.count:,}"
    for reference in stored.lineage.user_columns:
        layer, _, version = reference.partition("@")
        if not files.has(f"layers/{layer}/{version}.parquet"):
            yield f"it was made with the column {reference}, which is gone"


def _record(files: LakeFiles, file: str) -> DatabaseRecord:
    """Read the record of a database from its file."""
    _, name, version = file.removesuffix(".parquet").split("/")
    return records.read_version(files, name, int(version))


def _versions(files: LakeFiles, folder: str, found: Findings) -> Iterator[str]:
    """File of every version of every database or user column."""
    for name in files.folders(folder):
        found.refuse_folders(files, f"{folder}/{name}")
        dropped = records.numbers(records.DROPPED + folder, files, name, "")
        for number in records.numbers(folder, files, name):
            file = f"{folder}/{name}/{number}.parquet"
            if number in dropped:
                found.damages.append(Damage(file, "it was dropped, and has come back, for example from a copy"))
            yield file
