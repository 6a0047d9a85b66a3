"""Write a shared map in square tiles, each with its own origin and row group.

Coordinates are float32 offsets from the tile's origin, which keeps the precision of a scenario in a city of any size.
Features longer than a tile have separate row groups, so that they do not enlarge the bounds of others.
"""

from __future__ import annotations

import numpy as np

from scenarionet_data import codec
from scenarionet_data.arrays.dtypes import Float64, Int64
from scenarionet_data.building import MapBuilder
from scenarionet_data.ingest.shard import Shard
from scenarionet_data.schema import tables
from scenarionet_data.storage.files.errors import writing
from scenarionet_data.storage.files.lake_files import LakeFiles
from scenarionet_data.storage.snapshots.shard_record import ShardRecord, make_record, partition
from scenarionet_data.storage.write.table_file import defect_rows, publish_data, write_table

TILE = 200.0
"""Edge of a tile [m]."""


def write_shared_map(
    files: LakeFiles, shard: Shard, features: MapBuilder, converter_version: str, licence: str
) -> ShardRecord:
    """Publish the file of a shared map; a commit of the returned record adds it to the lake.

    Args:
        files: The lake's files.
        shard: A shard of ``Converter.maps``; its name is the map's id.
        features: In the source frame.
        converter_version: Version of the converter.
        licence: Licence of the source.
    """
    declared = tables.load("maps")
    has_z = features.has_heights
    temporary = files.temporary()
    footer = {"scenarionet.map": shard.name, "scenarionet.licence": licence}
    with writing(temporary, temporary), declared.writer(temporary, footer) as writer:
        for number, (rows, origin) in enumerate(_tiles(features.bounds)):
            tile = features.take(rows).build(origin, has_z)
            batch = codec.encode_map(shard.name, tile, origin, has_z, tile=number, index=rows)
            writer.write_batch(batch, row_group_size=max(batch.num_rows, 1))
    published = [publish_data(files, temporary, f"{partition('maps', shard.dataset, shard.version, '')}/{shard.name}")]
    if features.defects:
        temporary = write_table(files, "defects", defect_rows(shard, features.defects, map_id=shard.name), footer)
        stem = f"{partition('defects', shard.dataset, shard.version, '')}/{shard.name}"
        published.append(publish_data(files, temporary, stem))
    return make_record(shard, converter_version, published)


def _tiles(bounds: Float64) -> list[tuple[Int64, Float64]]:
    """Features and origin of each tile; long features have separate tiles, those without geometry are put at 0."""
    boxes = np.nan_to_num(bounds)
    cell = np.floor((boxes[:, :2] + boxes[:, 2:]) / 2 / TILE).astype(np.int64)
    is_long = (boxes[:, 2:] - boxes[:, :2]).max(axis=1, initial=0.0) > TILE
    keys = np.column_stack([is_long, cell])
    if not len(keys):
        return [(np.zeros(0, np.int64), np.zeros(3))]
    distinct, tile = np.unique(keys, axis=0, return_inverse=True)
    origins = np.column_stack([(distinct[:, 1:] + 0.5) * TILE, np.zeros(len(distinct))])
    return [(np.flatnonzero(tile.ravel() == number), origins[number]) for number in range(len(distinct))]
