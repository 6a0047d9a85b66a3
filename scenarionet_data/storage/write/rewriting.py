"""Rewrite shards in another file layout: the same rows in other files and row groups.

The content of scenarios does not change, so ids and content hashes stay valid. Each shard keeps its own record and
metadata file; its rows may share files with other shards that are rewritten in the same call.
"""

from __future__ import annotations

import json
from collections import defaultdict
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, replace
from pathlib import Path

import pyarrow as pa
import pyarrow.compute as pc
import pyarrow.parquet as pq

from scenarionet_data.errors import LakeError
from scenarionet_data.storage.files.errors import reading, writing
from scenarionet_data.storage.files.lake_files import LakeFiles
from scenarionet_data.storage.read.scenario_rows import RowAddress, ScenarioRows
from scenarionet_data.storage.snapshots.shard_record import ShardRecord, find_record, partition
from scenarionet_data.storage.write.layouts import Layout, new_unit, rewritten_name
from scenarionet_data.storage.write.relocation import (
    MAP_FOOTER,
    addresses,
    copy_groups,
    copy_rows,
    provenance,
    with_addresses,
)
from scenarionet_data.storage.write.table_file import publish_data, publish_table

TABLES = ("tracks", "lights", "maps")


def rewrite(files: LakeFiles, records: Sequence[ShardRecord], layout: Layout) -> list[ShardRecord]:
    """Rewrite shards of one partition together, in order, and return their new records; nothing is committed.

    Files that an interrupted run has finished are used as they are.

    Raises:
        LakeError: A file is missing or damaged, or the lake cannot be written.
    """
    unit = new_unit(records, layout)
    names = [rewritten_name(record, layout, unit) for record in records]
    finished = [find_record(files, name) for name in names]
    if None not in finished:
        return [record for record in finished if record is not None]
    metadata = pa.concat_tables(
        (_numbered(files, number, record) for number, record in enumerate(records)), promote_options="default"
    )
    writer = FileWriter(files, records[0], layout, unit)
    size = -(-metadata.num_rows // layout.num_files(metadata.num_rows))
    chunks = [writer.write(metadata.slice(start, size)) for start in range(0, metadata.num_rows, size)]
    return list(_publish(files, records, names, pa.concat_tables(chunks), writer.published))


def rewrite_shared_map(files: LakeFiles, record: ShardRecord) -> ShardRecord:
    """Rewrite the file of a shared map, and return its new record; nothing is committed.

    Raises:
        LakeError: The file is missing or damaged, or the lake cannot be written.
    """
    source = next(name for name in record.files if name.startswith("maps/"))
    temporary = files.temporary()
    copy_groups(files, "maps", source, range(files.footer(source).num_row_groups), temporary, MAP_FOOTER)
    sealed = publish_data(files, temporary, source.rpartition("-")[0])
    written = zip(record.files, record.sizes, record.checksums, strict=True)
    now = [(sealed.name, sealed.size, sealed.checksum), *(each for each in written if each[0] != source)]
    names, sizes, checksums = map(list, zip(*now, strict=True))
    return replace(record, files=names, sizes=sizes, checksums=checksums)


def _numbered(files: LakeFiles, number: int, record: ShardRecord) -> pa.Table:
    """A shard's metadata rows, with the shard's number as a further column."""
    rows = files.read(str(record.metadata_file))
    return rows.replace_schema_metadata(None).append_column("_shard", pa.array([number] * rows.num_rows, pa.int32()))


def _publish(
    files: LakeFiles,
    records: Sequence[ShardRecord],
    names: Sequence[str],
    metadata: pa.Table,
    published: Mapping[str, tuple[int, str]],
) -> Iterator[ShardRecord]:
    """Publish the metadata file of each shard, after its other files, and yield its new record."""
    for number, (record, name) in enumerate(zip(records, names, strict=True)):
        rows = metadata.filter(pc.equal(metadata["_shard"], number)).drop_columns(["_shard"])
        named = {file for table in TABLES for file in rows[f"{table}_file"].to_pylist() if file is not None}
        kept = {
            file: (size, checksum)
            for file, size, checksum in zip(record.files, record.sizes, record.checksums, strict=True)
            if file.startswith(("quarantine/", "defects/"))
        }
        kept |= {file: published[file] for file in sorted(named)}
        moved = replace(
            record,
            metadata_file=name,
            files=list(kept),
            sizes=[size for size, _ in kept.values()],
            checksums=[checksum for _, checksum in kept.values()],
        )
        footer = provenance(files, [str(record.metadata_file)]) | {"scenarionet.shard": json.dumps(asdict(moved))}
        publish_table(files, "metadata", rows, footer, name)
        yield moved


class FileWriter:
    """Writes files of scenarios, one of each table at a time.

    Attributes:
        published: Size and checksum of each file.
    """

    def __init__(self, files: LakeFiles, example: ShardRecord, layout: Layout, unit: str) -> None:
        self.published: dict[str, tuple[int, str]] = {}
        self._files = files
        self._partition = (example.dataset, example.version, example.split)
        self._layout = layout
        self._unit = unit
        self._sources = {table: ScenarioRows(files, table) for table in TABLES}
        self._footer = provenance(files, [str(example.metadata_file)]) | {
            "scenarionet.source": " ".join((*self._partition, f"{layout.name}-{unit}")),
            "scenarionet.profile": layout.name,
        }
        self._number = 0

    def write(self, metadata: pa.Table) -> pa.Table:
        """Write the scenarios of some metadata rows to one file a table; returns the rows with new addresses."""
        for table in TABLES:
            metadata = self._write_table(table, metadata)
        self._number += 1
        return metadata

    def _write_table(self, table: str, metadata: pa.Table) -> pa.Table:
        chosen = {number: address for number, address in enumerate(addresses(metadata, table)) if address.num_rows}
        if not chosen:
            return metadata
        temporary = self._files.temporary()
        footer = self._footer | {"scenarionet.num_scenarios": str(metadata.num_rows)}
        per_group = self._layout.scenarios_per_group
        with writing(temporary, temporary):
            copied = copy_rows(self._sources[table], table, [*chosen.values()], temporary, footer, per_group)
        ids = metadata["scenario_id"].to_pylist()
        _check(temporary, table, {ids[k]: address for k, address in zip(chosen, copied, strict=True)})
        stem = f"{partition(table, *self._partition)}/{self._layout.name}-{self._unit}-{self._number:03d}"
        sealed = publish_data(self._files, temporary, stem)
        self.published[sealed.name] = sealed.size, sealed.checksum
        return with_addresses(metadata, table, sealed.name, dict(zip(chosen, copied, strict=True)))


def _check(path: Path, table: str, written: Mapping[str, RowAddress]) -> None:
    """Verify that each row group holds the rows that were written to it.

    Args:
        path: The file.
        table: Its table.
        written: Addresses by scenario id, in order; the file contains nothing else.

    Raises:
        LakeError: The rows differ.
    """
    key = "map_id" if table == "maps" else "scenario_id"
    expected: dict[int, list[str]] = defaultdict(list)
    for scenario_id, address in written.items():
        expected[address.row_group] += [scenario_id] * address.num_rows
    with reading(path), pq.ParquetFile(path) as file:
        found = {
            group: file.read_row_group(group, [key], use_threads=False)[key].to_pylist()
            for group in range(file.num_row_groups)
        }
    if found != expected:
        raise LakeError(f"{path}: read back other rows than were written; check the disk and run the command again")
