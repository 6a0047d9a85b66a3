"""fsck of databases and user columns."""

from __future__ import annotations

import json
from collections import defaultdict
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass

import pyarrow as pa

from scenarionet_data.databases import pack_origins
from scenarionet_data.databases import record as databases
from scenarionet_data.databases.record import Lineage
from scenarionet_data.errors import LakeError
from scenarionet_data.maintenance.findings import Findings
from scenarionet_data.schema import tables
from scenarionet_data.storage.file_checks import Damage, Written, check_file
from scenarionet_data.storage.files.lake_files import LakeFiles
from scenarionet_data.storage.snapshots.snapshot import Snapshot

_MEMBER = ["scenario_id", "content_hash"]
_BATCH = 1_000_000
"""Members that are compared with a snapshot at once; most of a comparison's cost is reading the snapshot's rows."""


@dataclass(frozen=True)
class StoredDatabase:
    """A readable version of a database.

    Attributes:
        file: Its file.
        lineage: How it was made.
        count: Members in the file.
    """

    file: str
    lineage: Lineage
    count: int


def read_all(files: LakeFiles, found: Findings, *, is_deep: bool) -> list[StoredDatabase]:
    """Check the files of all databases and user columns; return the readable databases."""
    stored: list[StoredDatabase] = []
    for file in _versions(files, "databases", found):
        with found.of(file):
            intact = check_file(files, file, Written(), table="members", is_deep=is_deep)
            lineage = Lineage.from_dict(json.loads(intact.footer[b"scenarionet.lineage"]))
            stored.append(StoredDatabase(file, lineage, int(intact.groups.sum())))
            found.saw(file, is_sealed=intact.is_sealed)
    for file in _versions(files, "layers", found):
        with found.of(file):
            intact = check_file(files, file, Written(), table=None, is_deep=is_deep)
            column = json.loads(intact.footer[b"scenarionet.layer"])
            if f"layers/{column['name']}/{column['version']}.parquet" != file:
                raise LakeError(f"holds the column {column['name']}@{column['version']}")
            found.saw(file, is_sealed=intact.is_sealed)
    return stored


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
    contents = _Contents(files, readable, found)
    listed = list(stored)
    for each in listed:
        found.damages += (Damage(each.file, reason) for reason in _contradictions(files, each))
    changed = contents.lost(listed, max(readable, default=0))
    made_on: dict[int, list[StoredDatabase]] = defaultdict(list)
    for each in listed:  # a database with changed members is read from the snapshot it was made on
        if changed.get(each.file):
            made_on[each.lineage.snapshot].append(each)
    for number, group in made_on.items():
        if number not in readable:
            reason = f"members have changed, and snapshot {number}, which it was made on, is gone"
            found.damages += (Damage(each.file, reason) for each in group)
        lost = contents.lost(group, number) if number in readable else {}
        found.damages += (
            Damage(
                each.file,
                f"{lost[each.file]:,} of {each.count:,} members are not in snapshot {number}, which it was made on",
            )
            for each in group
            if lost.get(each.file)
        )
    with found.of(pack_origins.FILE):
        if files.has(pack_origins.FILE):
            found.saw(pack_origins.FILE, is_sealed=pack_origins.parse(files)[1])


class _Contents:
    """Scenarios of snapshots."""

    def __init__(self, files: LakeFiles, readable: Mapping[int, Snapshot], found: Findings) -> None:
        self._files = files
        self._readable = readable
        self._found = found
        self._broken = found.broken

    def lost(self, stored: Iterable[StoredDatabase], number: int) -> dict[str, int]:
        """Number of members missing or changed in a snapshot, by file; empty if the snapshot is damaged."""
        names = self._readable[number].metadata if number in self._readable else ()
        empty = tables.load("metadata").schema.empty_table().select(_MEMBER)
        scenarios = None
        lost: dict[str, int] = {}
        if self._broken.intersection(names):
            return lost
        for members in self._members(stored):
            if scenarios is None:
                scenarios = pa.concat_tables([empty, *self._files.read_all(names, _MEMBER)])
            missing = members.join(scenarios, _MEMBER, join_type="left anti")
            counts = missing["file"].combine_chunks().value_counts()
            lost |= zip(counts.field("values").to_pylist(), counts.field("counts").to_pylist(), strict=True)
        return lost

    def _members(self, stored: Iterable[StoredDatabase]) -> Iterator[pa.Table]:
        """Members of databases with the file of each, in batches."""
        waiting: list[pa.Table] = []
        num_waiting = 0
        for each in stored:
            with self._found.of(each.file):
                rows = self._files.read(each.file, _MEMBER).replace_schema_metadata(None)
                file = pa.repeat(pa.scalar(each.file), rows.num_rows)
                waiting.append(rows.append_column("file", file))
                num_waiting += rows.num_rows
            if num_waiting > _BATCH:
                yield pa.concat_tables(waiting)
                waiting, num_waiting = [], 0
        if waiting:
            yield pa.concat_tables(waiting)


def _contradictions(files: LakeFiles, stored: StoredDatabase) -> Iterator[str]:
    """Yield contradictions between a database and its lineage."""
    if stored.count != stored.lineage.count:
        yield f"{stored.count:,} members, was written with {stored.lineage.count:,}"
    for reference in stored.lineage.user_columns:
        layer, _, version = reference.partition("@")
        if not files.has(f"layers/{layer}/{version}.parquet"):
            yield f"it was made with the column {reference}, which is gone"


def _versions(files: LakeFiles, folder: str, found: Findings) -> Iterator[str]:
    """File of every version of every database or user column."""
    for name in files.folders(folder):
        found.refuse_folders(files, f"{folder}/{name}")
        for file in files.names(f"{folder}/{name}", ".parquet"):
            if file.rpartition("/")[2].removesuffix(".parquet").isdecimal():
                yield file
