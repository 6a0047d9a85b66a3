"""Rewrite shards in another file layout: the same rows in other files and row groups.

The content of scenarios does not change, so ids and content hashes stay valid. Each shard keeps its own record and
metadata file; its rows may share files with other shards that are rewritten in the same call.
"""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import replace

import pyarrow as pa
import pyarrow.compute as pc

from scenarionet_data.schema import tables
from scenarionet_data.storage.files.lake_files import LakeFiles
from scenarionet_data.storage.snapshots.shard_record import ShardRecord, files_of, find_record, with_files
from scenarionet_data.storage.write.layouts import Layout, new_unit, rewritten_name
from scenarionet_data.storage.write.relocation import MAP_FOOTER, FileWriter, copy_groups, provenance
from scenarionet_data.storage.write.table_file import publish_data, publish_table


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
    parts = []
    for number, record in enumerate(records):
        rows = files.read(str(record.metadata_file)).replace_schema_metadata(None)
        parts.append(rows.append_column("_shard", pa.array([number] * rows.num_rows, pa.int32())))
    metadata = pa.concat_tables(parts, promote_options="default")
    writer = writer_for(files, records[0], layout, unit)
    size = -(-metadata.num_rows // layout.num_files(metadata.num_rows))
    chunks = [writer.write(metadata.slice(start, size)) for start in range(0, metadata.num_rows, size)]
    metadata, moved = pa.concat_tables(chunks), []
    for number, (record, name) in enumerate(zip(records, names, strict=True)):
        rows = metadata.filter(pc.equal(metadata["_shard"], number)).drop_columns(["_shard"])
        named = {file for table in tables.LOADED for file in rows[f"{table}_file"].to_pylist()}
        held = sorted(sealed for sealed in writer.published if sealed.name in named)
        kept = files_of(record, "quarantine/", "defects/")
        new = replace(with_files(record, [*kept, *held]), metadata_file=name)
        moved.append(publish_rewritten(files, new, record, rows))
    return moved


def publish_rewritten(files: LakeFiles, new: ShardRecord, old: ShardRecord, rows: pa.Table) -> ShardRecord:
    """Publish the metadata file of a rewritten shard, after its other files; returns its record."""
    footer = provenance(files, [str(old.metadata_file)]) | {"scenarionet.shard": json.dumps(vars(new))}
    publish_table(files, "metadata", rows, footer, str(new.metadata_file))
    return new


def rewrite_shared_map(files: LakeFiles, record: ShardRecord) -> ShardRecord:
    """Rewrite the file of a shared map, and return its new record; nothing is committed.

    Raises:
        LakeError: The file is missing or damaged, or the lake cannot be written.
    """
    ((source, _, _),) = files_of(record, "maps/")
    temporary = files.temporary()
    copy_groups(files, "maps", source, range(files.footer(source).num_row_groups), temporary, MAP_FOOTER)
    sealed = publish_data(files, temporary, source.rpartition("-")[0])
    return with_files(record, [sealed, *files_of(record, "defects/")])


def writer_for(files: LakeFiles, record: ShardRecord, layout: Layout, unit: str) -> FileWriter:
    """Writer of the files of rewritten shards, one of which is ``record``."""
    footer = provenance(files, [str(record.metadata_file)]) | {"scenarionet.profile": layout.name}
    folder, name = (record.dataset, record.version, record.split), f"{layout.name}-{unit}"
    return FileWriter(files, files, folder, name, footer, layout.scenarios_per_group, layout.zstd_level)
