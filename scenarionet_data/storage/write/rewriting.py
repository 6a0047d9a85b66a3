"""Shards written anew in another profile: the same rows in other files and row groups, and where they now lie.

Nothing that a scenario says is touched, so ids and content hashes stay. Each shard keeps a record and a metadata file
of its own; its rows may share files with those of the others that are rewritten together.
"""

from __future__ import annotations

import json
from collections import defaultdict
from collections.abc import Iterator, Mapping, Sequence
from contextlib import ExitStack
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc
import pyarrow.parquet as pq

from scenarionet_data.errors import LakeError
from scenarionet_data.schema import tables
from scenarionet_data.storage.files.errors import reading, writing
from scenarionet_data.storage.files.lake_files import LakeFiles, sha256
from scenarionet_data.storage.read.scenario_rows import Address, ScenarioRows
from scenarionet_data.storage.snapshots.shard_record import ShardRecord, find_record, partition
from scenarionet_data.storage.write.layouts import Profile, new_unit, rewritten_name
from scenarionet_data.storage.write.table_file import write_table

TABLES = ("tracks", "lights", "maps")
_OWN_WORDS = (b"scenarionet.source", b"scenarionet.converter", b"scenarionet.licence", b"scenarionet.frame")


def rewrite(files: LakeFiles, records: Sequence[ShardRecord], profile: Profile) -> list[ShardRecord]:
    """Write shards of one partition together, in their order, and return their new records; nothing is committed.

    What an interrupted run has finished is taken as it is.

    Raises:
        LakeError: A file of theirs is gone or damaged, or the lake cannot be written.
    """
    unit = new_unit(records, profile)
    names = [rewritten_name(record, profile, unit) for record in records]
    finished = [find_record(files, name) for name in names]
    if None not in finished:
        return [record for record in finished if record is not None]
    metadata = pa.concat_tables(_numbered(files, number, record) for number, record in enumerate(records))
    parts = _Parts(files, records[0], profile, unit)
    size = -(-metadata.num_rows // profile.num_files(metadata.num_rows))
    chunks = [parts.write(metadata.slice(start, size)) for start in range(0, metadata.num_rows, size)]
    return list(_publish(files, records, names, pa.concat_tables(chunks), parts.published))


def _numbered(files: LakeFiles, number: int, record: ShardRecord) -> pa.Table:
    """A shard's rows of metadata, with its place among the shards."""
    rows = files.read(str(record.metadata_file))
    return rows.replace_schema_metadata(None).append_column("_shard", pa.array([number] * rows.num_rows, pa.int32()))


def _publish(
    files: LakeFiles,
    records: Sequence[ShardRecord],
    names: Sequence[str],
    metadata: pa.Table,
    published: Mapping[str, tuple[int, str]],
) -> Iterator[ShardRecord]:
    """Publish each shard's metadata, last of its files, and give its new record."""
    for number, (record, name) in enumerate(zip(records, names, strict=True)):
        rows = metadata.filter(pc.equal(metadata["_shard"], number)).drop_columns(["_shard"])
        named = {file for table in TABLES for file in rows[f"{table}_file"].to_pylist() if file is not None}
        there = {
            file: (size, checksum)
            for file, size, checksum in zip(record.files, record.sizes, record.checksums, strict=True)
            if file.startswith("quarantine/")
        }
        there |= {file: published[file] for file in sorted(named)}
        moved = replace(
            record,
            metadata_file=name,
            files=list(there),
            sizes=[size for size, _ in there.values()],
            checksums=[checksum for _, checksum in there.values()],
        )
        footer = _words(files, str(record.metadata_file)) | {"scenarionet.shard": json.dumps(asdict(moved))}
        files.publish(write_table(files, "metadata", rows, footer), name)
        yield moved


def _words(files: LakeFiles, name: str) -> dict[str, str]:
    """What a file says about where its rows come from."""
    footer = files.footer(name).metadata
    return {key.decode(): footer[key].decode() for key in _OWN_WORDS if key in footer}


class _Parts:
    """Writes files of scenarios, one of each table at a time.

    Attributes:
        published: Size and checksum of each file.
    """

    def __init__(self, files: LakeFiles, example: ShardRecord, profile: Profile, unit: str) -> None:
        self.published: dict[str, tuple[int, str]] = {}
        self._files = files
        self._place = (example.dataset, example.version, example.split)
        self._profile = profile
        self._unit = unit
        self._sources = {table: ScenarioRows(files, table) for table in TABLES}
        self._words = _words(files, str(example.metadata_file)) | {
            "scenarionet.source": " ".join((*self._place, f"{profile.name}-{unit}")),
            "scenarionet.profile": profile.name,
        }
        self._number = 0

    def write(self, rows: pa.Table) -> pa.Table:
        """Write the scenarios of some metadata rows, a file a table; returns the rows with their new addresses."""
        for table in TABLES:
            rows = self._write_table(table, rows)
        self._number += 1
        return rows

    def _write_table(self, table: str, rows: pa.Table) -> pa.Table:
        old = _addresses(rows, table)
        ids = rows["scenario_id"].to_pylist()
        chosen = [number for number, address in enumerate(old) if address[3]]
        if not chosen:
            return rows
        temporary = self._files.temporary()
        with writing(temporary, temporary):
            new = self._write_groups(table, temporary, [old[number] for number in chosen], rows.num_rows)
        _check(temporary, table, [(ids[k], group, old[k][3]) for k, (group, _) in zip(chosen, new, strict=True)])
        return _moved(rows, table, self._publish(table, temporary), dict(zip(chosen, new, strict=True)))

    def _write_groups(
        self, table: str, path: Path, addresses: list[Address], num_scenarios: int
    ) -> list[tuple[int, int]]:
        """Write the rows at some addresses to a file; returns row group and first row of each there."""
        declared, source, per_group = tables.load(table), self._sources[table], self._profile.scenarios_per_group
        words = self._words | {"scenarionet.num_scenarios": str(num_scenarios)}
        new: list[tuple[int, int]] = []
        with ExitStack() as stack:
            writer = None
            for group, start in enumerate(range(0, len(addresses), per_group)):
                read = [source.read(*address) for address in addresses[start : start + per_group]]
                together = pa.concat_tables(read).combine_chunks().cast(declared.schema)
                writer = writer or stack.enter_context(declared.writer(path, words, together))
                writer.write_table(together, row_group_size=together.num_rows)
                ends = np.cumsum([part.num_rows for part in read])
                new += [(group, int(end) - part.num_rows) for end, part in zip(ends, read, strict=True)]
        return new

    def _publish(self, table: str, temporary: Path) -> str:
        checksum, size = sha256(temporary), temporary.stat().st_size
        stem = f"{self._profile.name}-{self._unit}-{self._number:03d}"
        name = f"{partition(table, *self._place)}/{stem}-{checksum[:16]}.parquet"
        self._files.publish(temporary, name)
        self.published[name] = size, checksum
        return name


def _addresses(rows: pa.Table, table: str) -> list[Address]:
    columns = (rows[f"{table}_{part}"].to_pylist() for part in ("file", "row_group", "first_row", "num_rows"))
    return list(zip(*columns, strict=True))


def _moved(rows: pa.Table, table: str, name: str, new: Mapping[int, tuple[int, int]]) -> pa.Table:
    """Metadata rows that say where a table's rows lie now: in one file, at row group and first row by row number."""
    places = [new.get(number) for number in range(rows.num_rows)]
    values = {
        "file": pa.array([None if place is None else name for place in places], pa.string()),
        "row_group": pa.array([None if place is None else place[0] for place in places], pa.int32()),
        "first_row": pa.array([None if place is None else place[1] for place in places], pa.int32()),
    }
    for part, column in values.items():
        rows = rows.set_column(rows.column_names.index(f"{table}_{part}"), f"{table}_{part}", column)
    return rows


def _check(path: Path, table: str, written: list[tuple[str, int, int]]) -> None:
    """Read back who lies where.

    Args:
        path: The file.
        table: Its table.
        written: Scenario id, row group and number of rows, in order; nothing else is in the file.

    Raises:
        LakeError: It is not as it was written.
    """
    key = "map_id" if table == "maps" else "scenario_id"
    wanted: dict[int, list[str]] = defaultdict(list)
    for scenario_id, group, num_rows in written:
        wanted[group] += [scenario_id] * num_rows
    with reading(path), pq.ParquetFile(path) as file:
        found = {group: _ids(file, group, key) for group in range(file.num_row_groups)}
    if found != wanted:
        raise LakeError(f"{path}: read back other rows than were written; check the disk and run the command again")


def _ids(file: Any, group: int, key: str) -> list[str]:
    ids: list[str] = file.read_row_group(group, [key], use_threads=False)[key].to_pylist()
    return ids
