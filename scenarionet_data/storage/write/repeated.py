"""Leave out the scenarios of a finished shard whose ids the lake has already: quarantine them, keep the others."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from operator import itemgetter
from typing import Any

import pyarrow as pa
import pyarrow.compute as pc

from scenarionet_data.storage.files.lake_files import LakeFiles
from scenarionet_data.storage.snapshots.shard_record import ShardRecord, find_record, partition, with_files
from scenarionet_data.storage.write.layouts import layout_of, new_unit, rewritten_name
from scenarionet_data.storage.write.relocation import provenance
from scenarionet_data.storage.write.rewriting import publish_rewritten, writer_for
from scenarionet_data.storage.write.table_file import publish_data, write_table


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
    writer = writer_for(files, record, layout, unit)
    size = layout.scenarios_per_file
    chunks = [writer.write(kept.slice(start, size)) for start in range(0, kept.num_rows, size)]
    footer = provenance(files, [str(record.metadata_file)])
    defects = [row for row in _rows(files, record, "defects") if row["scenario_id"] not in repeated]
    for table, rows in (("quarantine", _quarantine(files, record, metadata, repeated)), ("defects", defects)):
        if rows:
            stem = f"{partition(table, record.dataset, record.version, record.split)}/{record.name}"
            writer.published.append(publish_data(files, write_table(files, table, rows, footer), stem))
    reduced = replace(
        with_files(record, writer.published),
        num_scenarios=kept.num_rows,
        num_quarantined=record.num_quarantined + len(repeated),
        metadata_file=name,
    )
    return publish_rewritten(files, reduced, record, pa.concat_tables(chunks) if chunks else kept)


def _quarantine(
    files: LakeFiles, record: ShardRecord, metadata: pa.Table, repeated: Mapping[str, str]
) -> list[dict[str, Any]]:
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
    return sorted(rows, key=itemgetter("position"))


def _rows(files: LakeFiles, record: ShardRecord, table: str) -> list[dict[str, Any]]:
    return [row for name in record.files if name.startswith(f"{table}/") for row in files.read(name).to_pylist()]
