"""Map features to rows and back."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt
import pyarrow as pa

from scenarionet_data.codec.arrow import (
    Rows,
    batch,
    codes_of,
    floats,
    id_lists,
    list_array,
    names_of,
    points,
    string_array,
    strings,
)
from scenarionet_data.codec.kernels import find_bounds
from scenarionet_data.ragged import Ragged
from scenarionet_data.scenario import ID_LISTS, MapFeatures
from scenarionet_data.vocabulary import MapFeatureType

Array = npt.NDArray[Any]


def encode_map(
    map_id: str,
    features: MapFeatures,
    origin: Array,
    has_z: bool,
    tile: int | None = None,
    index: Array | None = None,
) -> pa.RecordBatch:
    """Rows of a map.

    Args:
        map_id: The scenario's id, or the shared map's.
        features: In float32 offsets from ``origin``.
        origin: (3,) float64 [m], row frame to source frame.
        has_z: Whether z is recorded.
        tile: Spatial tile of a shared map.
        index: (M,) position of each feature in the whole map; their own order unless given.
    """
    count = len(features)
    box = _bounding_boxes(features)
    empty = np.isnan(box[:, 0])
    nulls = pa.nulls(count, pa.list_(pa.field("element", pa.float32(), nullable=False)))
    line, area = features.polyline, features.polygon
    inside = features.is_intersection
    columns: dict[str, Any] = {
        "map_id": pa.array([map_id] * count, pa.string()),
        "feature_id": string_array(features.ids),
        "feature_index": np.arange(count, dtype=np.int32) if index is None else index.astype(np.int32),
        "feature_type": names_of(features.types, MapFeatureType),
        "x": list_array(line.offsets, line.values[:, 0]),
        "y": list_array(line.offsets, line.values[:, 1]),
        "z": list_array(line.offsets, line.values[:, 2]) if has_z else nulls,
        "polygon_x": list_array(area.offsets, area.values[:, 0]),
        "polygon_y": list_array(area.offsets, area.values[:, 1]),
        "polygon_z": list_array(area.offsets, area.values[:, 2]) if has_z else nulls,
        "speed_limit": pa.array(features.speed_limit, mask=np.isnan(features.speed_limit)),
        "width_left": list_array(features.width.offsets, features.width.values[:, 0]),
        "width_right": list_array(features.width.offsets, features.width.values[:, 1]),
        "is_intersection": pa.array(inside == 1, mask=inside < 0),
        "extras": string_array(features.extras),
        "tile": pa.nulls(count, pa.int32()) if tile is None else np.full(count, tile, np.int32),
    }
    for axis, name in enumerate(("min_x", "min_y", "max_x", "max_y")):
        columns[name] = pa.array(box[:, axis], mask=empty)
    for axis, name in enumerate(("origin_x", "origin_y", "origin_z")):
        columns[name] = np.full(count, origin[axis], np.float64)
    for name in ID_LISTS:
        ragged: Ragged = getattr(features, name)
        columns[name] = list_array(ragged.offsets, string_array(ragged.values))
    return batch("maps", columns)


def decode_map(rows: Rows) -> MapFeatures:
    """Map features from their rows, in the rows' frame."""
    inside = rows.column("is_intersection")
    is_intersection = np.full(rows.num_rows, -1, np.int8)
    if inside.null_count < len(inside):
        is_intersection = inside.cast(pa.int8()).fill_null(-1).to_numpy(zero_copy_only=False)
    return MapFeatures(
        ids=strings(rows, "feature_id"),
        types=codes_of(rows.column("feature_type"), MapFeatureType),
        polyline=points(rows, "x", "y", "z"),
        polygon=points(rows, "polygon_x", "polygon_y", "polygon_z"),
        speed_limit=floats(rows, "speed_limit"),
        width=points(rows, "width_left", "width_right"),
        is_intersection=is_intersection,
        extras=strings(rows, "extras"),
        **{name: id_lists(rows, name) for name in ID_LISTS},
    )


def _bounding_boxes(features: MapFeatures) -> Array:
    """(M, 4) float32 min_x, min_y, max_x, max_y of polyline and polygon; NaN without geometry."""
    box = np.full((len(features), 4), np.nan, np.float32)
    find_bounds(features.polyline.offsets, features.polyline.values, box)
    find_bounds(features.polygon.offsets, features.polygon.values, box)
    return box
