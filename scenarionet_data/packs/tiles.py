"""Tiles of shared maps that a pack needs."""

from __future__ import annotations

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc

from scenarionet_data.building import meets
from scenarionet_data.schema import tables
from scenarionet_data.storage.files.lake_files import LakeFiles

_BOX = ("min_x", "min_y", "max_x", "max_y")

MapWindow = tuple[float, float, float, float]
"""min_x, min_y, max_x, max_y in the frame of the map [m]."""


def windows(rows: pa.Table) -> dict[tuple[str, str, str], list[MapWindow]]:
    """Return the windows of scenarios on each shared map, by dataset, version and map id."""
    seen = rows.filter(pc.is_valid(rows["map_crop"])).select(
        ["dataset", "version", "map_id", "map_crop", "origin_x", "origin_y"]
    )
    found: dict[tuple[str, str, str], list[MapWindow]] = {}
    for row in seen.to_pylist():
        (x, y), (min_x, min_y, max_x, max_y) = (row["origin_x"], row["origin_y"]), row["map_crop"]
        window = (x + min_x, y + min_y, x + max_x, y + max_y)
        found.setdefault((row["dataset"], row["version"], row["map_id"]), []).append(window)
    return found


def tiles_in(files: LakeFiles, name: str, windows: list[MapWindow]) -> list[int]:
    """Return the row groups of a shared map, each a tile, that intersect a window; the first if none does."""
    columns = ["tile", "origin_x", "origin_y", *_BOX]
    rows = tables.load("maps").conform(files.read(name, columns), columns)
    corner = [rows[f"origin_{axis}"].to_numpy() for axis in "xyxy"]
    boxes = np.column_stack([rows[column].to_numpy() for column in _BOX]).astype(np.float64) + np.column_stack(corner)
    first = np.flatnonzero(np.diff(rows["tile"].to_numpy(), prepend=-1))
    # Boxes of tiles, ignoring features without geometry (NaN).
    boxes_of_tiles = np.column_stack(
        [np.fmin.reduceat(boxes[:, :2], first, axis=0), np.fmax.reduceat(boxes[:, 2:], first, axis=0)]
    )
    is_seen = np.zeros(len(boxes_of_tiles), bool)
    for window in windows:
        is_seen |= meets(boxes_of_tiles, window)
    return [int(number) for number in np.flatnonzero(is_seen)] or [0]
