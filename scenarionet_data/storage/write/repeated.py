"""Leave out the scenarios of a finished shard whose ids the lake has already: quarantine them, keep the others."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import asdict, replace
from typing import Any

import pyarrow as pa
import pyarrow.compute as pc

from scenarionet_data.schema import tables
from scenarionet_data.storage.files.lake_files import LakeFiles
from scenarionet_data.storage.snapshots.shard_record import ShardRecord, find_record, partition
from scenarionet_data.storage.write.layouts import layout_of, new_unit, rewritten_name
from scenarionet_data.storage.write.relocation import provenance
from scenarionet_data.storage.write.rewriting import FileWriter
from scenarionet_data.storage.write.table_file import publish_data, publish_table, write_table


def leave_out(files: LakeFiles, record: ShardRecord, repeated: Mapping[str, str]) -> ShardRecord:
    """Write a shard again without some scenarios, which go to its quarantine; nothing is committed.

    The new record has the key and inputs of the old one, so that a later run skips them. Its files are found again by
    a later attempt to commit the shard.

    Args:
        files: The lake's files.
        record: A finished shard that shares no file with others.
        repeated: Scenarios to leave out, and where the lake has each.

    Raises:
        LakeError: A file is missing or damaged, or the lake cannot be written.
    """
    layout = layout_of(record)
    unit = new_unit([record], layout, repeated)
    name = rewritten_name(record, layout, unit)
    finished = find_record(files, name)
    if finished is not None:
        return finished
    metadata = files.read(str(record.metadata_file)).replace_schema_metadata(None)
    is_repeated = pc.is_in(metadata["scenario_id"], value_set=pa.array(list(repeated), pa.string()))
    kept = metadata.filter(pc.invert(is_repeated))
    writer = FileWriter(files, record, layout, unit)
    size = layout.scenarios_per_file
    chunks = [writer.write(kept.slice(start, size)) for start in range(0, kept.num_rows, size)]
    written = dict(writer.published)
    footer = provenance(files, [str(record.metadata_file)])
    for table, rows in (
        ("quarantine", _quarantine(files, record, metadata, repeated)),
        ("defects", _defects(files, record, repeated)),
    ):
        if rows.num_rows:
            stem = f"{partition(table, record.dataset, record.version, record.split)}/{record.name}"
            sealed = publish_data(files, write_table(files, table, rows, footer), stem)
            written[sealed.name] = sealed.size, sealed.checksum
    reduced = replace(
        record,
        num_scenarios=kept.num_rows,
        num_quarantined=record.num_quarantined + len(repeated),
        metadata_file=name,
        files=list(written),
        sizes=[size for size, _ in written.values()],
        checksums=[checksum for _, checksum in written.values()],
    )
    rows = pa.concat_tables(chunks) if chunks else kept
    publish_table(files, "metadata", rows, footer | {"scenarionet.shard": json.dumps(asdict(reduced))}, name)
    return reduced


def _quarantine(files: LakeFiles, record: ShardRecord, metadata: pa.Table, repeated: Mapping[str, str]) -> pa.Table:
    """The shard's quarantine with one more row for each repeated scenario, in the order of the records."""
    rows = _rows(files, record, "quarantine")
    rejected = {row["position"] for row in rows}
    positions = (position for position in range(metadata.num_rows + len(rejected)) if position not in rejected)
    for scenario_id, position in zip(metadata["scenario_id"].to_pylist(), positions, strict=True):
        if scenario_id in repeated:
            rows.append(
                {
                    "dataset": record.dataset,
                    "version": record.version,
                    "split": record.split,
                    "shard": record.name,
                    "position": position,
                    "scenario_id": scenario_id,
                    "error": "DuplicateScenario",
                    "field": "id",
                    "message": f"expected an id that the lake does not have, found it in {repeated[scenario_id]}; give "
                    "these recordings a version of their own, or pass replace=True to replace the others",
                }
            )
    return _table("quarantine", sorted(rows, key=lambda row: row["position"]))


def _defects(files: LakeFiles, record: ShardRecord, repeated: Mapping[str, str]) -> pa.Table:
    """The shard's defects without those of the repeated scenarios."""
    return _table("defects", [row for row in _rows(files, record, "defects") if row["scenario_id"] not in repeated])


def _rows(files: LakeFiles, record: ShardRecord, table: str) -> list[dict[str, Any]]:
    return [row for name in record.files if name.startswith(f"{table}/") for row in files.read(name).to_pylist()]


def _table(table: str, rows: list[dict[str, Any]]) -> pa.Table:
    return pa.Table.from_pylist(rows, schema=tables.load(table).schema)
