"""Write whole tables to files, and publish files under sealed names."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import asdict
from pathlib import Path
from typing import Any

import pyarrow as pa

from scenarionet_data.ingest.shard import Shard
from scenarionet_data.scenario.defects import Defect
from scenarionet_data.schema import tables
from scenarionet_data.storage.files.errors import writing
from scenarionet_data.storage.files.lake_files import LakeFiles
from scenarionet_data.storage.integrity import seals
from scenarionet_data.storage.integrity.seals import Sealed


def publish_table(
    files: LakeFiles,
    table: str,
    rows: list[dict[str, Any]] | pa.Table,
    footer: Mapping[str, str],
    name: str,
    row_group_size: int | None = None,
) -> None:
    """Write rows of a table to a file of this name, sealed; nullable columns that they lack become null."""
    temporary = write_table(files, table, rows, footer, row_group_size)
    with writing(temporary, temporary):
        seals.seal(temporary, files.place_to_write(name))
    files.publish(temporary, name)


def publish_data(files: LakeFiles, temporary: Path, stem: str) -> Sealed:
    """Seal a finished temporary file of a table and publish it under a name by its content.

    Args:
        files: The lake.
        temporary: The file.
        stem: Its name up to the digest of the content.
    """
    with writing(temporary, temporary):
        sealed = seals.seal(temporary, stem)
    files.publish(temporary, sealed.name)
    return sealed


def write_table(
    files: LakeFiles,
    table: str,
    rows: list[dict[str, Any]] | pa.Table,
    footer: Mapping[str, str],
    row_group_size: int | None = None,
) -> Path:
    """Write rows of a table to a temporary file and return its path."""
    declared = tables.load(table)
    content = rows if isinstance(rows, pa.Table) else pa.Table.from_pylist(rows, schema=declared.schema)
    temporary = files.temporary()
    with writing(temporary, temporary), declared.writer(temporary, footer) as writer:
        writer.write_table(declared.conform(content), row_group_size=row_group_size)
    return temporary


def defect_rows(
    shard: Shard, defects: Iterable[Defect], *, scenario_id: str | None = None, map_id: str | None = None
) -> list[dict[str, Any]]:
    """Return rows of the table ``defects`` for one scenario or one shared map of a shard."""
    owner = {"dataset": shard.dataset, "version": shard.version, "split": shard.split, "shard": shard.name}
    return [{**owner, "scenario_id": scenario_id, "map_id": map_id, **asdict(defect)} for defect in defects]
