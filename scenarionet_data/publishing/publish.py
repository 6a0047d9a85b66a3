"""Publishes a snapshot for engines that read Iceberg or DuckLake.

Tracks, lights and maps are referenced where they are. The metadata are written again: Iceberg has no unsigned integers,
so content hashes are published as the signed integers of the same 64 bits, and the lake's user columns are added.
"""

from __future__ import annotations

import shutil
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import pyarrow as pa
import pyarrow.compute as pc
import pyarrow.parquet as pq

from scenarionet_data.databases.record import all_records
from scenarionet_data.errors import BadParameter
from scenarionet_data.publishing.ducklake import write_ducklake
from scenarionet_data.publishing.iceberg import write_iceberg
from scenarionet_data.query.lake_view import LakeLike, open_view
from scenarionet_data.schema import tables
from scenarionet_data.storage.files.errors import writing
from scenarionet_data.storage.files.places import is_url, local_path

Catalog = Literal["iceberg", "ducklake"]
_WRITERS = {"iceberg": write_iceberg, "ducklake": write_ducklake}


@dataclass(frozen=True)
class PublishReport:
    """What was published.

    Attributes:
        path: Folder of the catalog.
        catalog: The kind of catalog.
        snapshot: Number of the published snapshot.
        is_kept: Whether the snapshot's files stay when ``vacuum`` expires it: a saved database was made on it.
        num_rows: Number of rows by table.
        locations: Where each table is: the metadata of an Iceberg table, or the DuckLake's file.
    """

    path: Path
    catalog: Catalog
    snapshot: int
    is_kept: bool
    num_rows: Mapping[str, int]
    locations: Mapping[str, str]


def publish(lake: LakeLike, path: str | Path, catalog: Catalog) -> PublishReport:
    """Publish a snapshot of a lake; see :meth:`Lake.publish <scenarionet_data.Lake.publish>`."""
    view = open_view(lake)
    out = local_path(path, "a catalog").absolute()
    if is_url(view.root):
        raise BadParameter(
            f"{view.root}: only lakes in local folders are published; copy it first (scenarionet db copy)"
        )
    if catalog not in _WRITERS:
        raise BadParameter(f"catalog={catalog!r}; choose from {', '.join(_WRITERS)}")
    if out.exists() or out.is_symlink():
        raise BadParameter(f"{out}: exists; choose another name, or remove it first")
    if not view.paths("metadata"):
        raise BadParameter(f"{view.root}: the lake is empty: nothing to publish")
    files = {name: [str(Path(file).absolute()) for file in view.paths(name)] for name in ("tracks", "lights", "maps")}
    try:
        with writing(out):
            out.mkdir(parents=True)
            metadata = out / "metadata.parquet"
            rows = view.arrow("SELECT * FROM metadata ORDER BY scenario_id")
            place = rows.column_names.index("content_hash")
            signed = [pc.cast(chunk, pa.uint64()).view(pa.int64()) for chunk in rows["content_hash"].chunks]
            pq.write_table(rows.set_column(place, "content_hash", pa.chunked_array(signed, pa.int64())), metadata)
            for name in (name for name, listed in files.items() if not listed):  # a lake need not have lights
                files[name] = [str(out / f"{name}.parquet")]
                pq.write_table(tables.load(name).schema.empty_table(), files[name][0])
        files = {"metadata": [str(metadata)], **files}
        locations = _WRITERS[catalog](out, files)
    except BaseException:  # a part of a catalog is not found by any reader
        shutil.rmtree(out, ignore_errors=True)
        raise
    num_rows = {name: sum(pq.read_metadata(file).num_rows for file in listed) for name, listed in files.items()}
    number = view.snapshot.number
    is_kept = any(record.lineage.snapshot == number for record in all_records(view.files))
    return PublishReport(out, catalog, number, is_kept, num_rows, locations)
