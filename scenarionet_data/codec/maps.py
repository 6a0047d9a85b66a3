"""Encode map features as table rows, and decode them."""

from __future__ import annotations

from typing import Any, ClassVar

import numpy as np
import pyarrow as pa

from scenarionet_data.arrays.columns import Columns
from scenarionet_data.arrays.dtypes import Array
from scenarionet_data.arrays.ragged import Ragged
from scenarionet_data.codec.arrow import batch, list_array, names_of, string_array
from scenarionet_data.codec.check_kernels import OR_NONE, check_lengths
from scenarionet_data.codec.feature_kernels import fill_features, find_bounds
from scenarionet_data.codec.stored_part import StoredPart
from scenarionet_data.scenario.description import ID_LISTS, MapFeatures
from scenarionet_data.scenario.vocabulary import MapFeatureType

_FIRST_AXES = {
    **dict.fromkeys(("x", "y", "z"), "x"),
    **dict.fromkeys(("polygon_x", "polygon_y", "polygon_z"), "polygon_x"),
    **dict.fromkeys(("width_left", "width_right"), "width_left"),
}
"""Columns of coordinates, and those with as many elements."""


def encode_map(
    map_id: str,
    features: MapFeatures,
    origin: Array,
    has_z: bool,
    tile: int | None = None,
    index: Array | None = None,
) -> pa.RecordBatch:
    """Encode a map as rows.

    Args:
        map_id: Id of the scenario, or of the shared map.
        features: In float32 offsets from ``origin``.
        origin: (3,) float64 [m] of the rows' frame in the source frame.
        has_z: Whether z is recorded.
        tile: Spatial tile of a shared map.
        index: (M,) position of each feature in the whole map; by default 0, 1, ...
    """
    count = len(features)
    box = np.full((count, 4), np.nan, np.float32)  # of polyline and polygon; NaN without geometry
    for points in (features.polyline, features.polygon):
        find_bounds(points.offsets, points.values, box)
    empty = np.isnan(box[:, 0])
    nulls = pa.nulls(count, pa.list_(pa.field("element", pa.float32(), nullable=False)))
    line, area = features.polyline, features.polygon
    inside = features.is_intersection
    columns: dict[str, Any] = {
        "map_id": pa.array([map_id] * count, pa.string()),
        "feature_id": string_array(features.ids),
        "feature_index": np.arange(count, dtype=np.int32) if index is None else index.astype(np.int32),
        "feature_type": names_of(features.feature_type, MapFeatureType),
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


class StoredFeatures(StoredPart):
    """Map features in memory, in the frame of the rows; see ``MapFeatures`` for the shapes."""

    table = "maps"
    columns = (*_FIRST_AXES, "speed_limit", "feature_type", "is_intersection")
    words: ClassVar = {"feature_type": MapFeatureType}
    fill = fill_features
    expected = "does not match its polylines"
    arrays: ClassVar = {
        "polyline": (np.float32, "x", (3,)),
        "polygon": (np.float32, "polygon_x", (3,)),
        "width": (np.float32, "width_left", (2,)),
        "speed_limit": (np.float32, "rows", ()),
        "polyline_offsets": (np.int32, "ends", ()),
        "polygon_offsets": (np.int32, "ends", ()),
        "width_offsets": (np.int32, "ends", ()),
        "feature_type": (np.uint8, "rows", ()),
        "is_intersection": (np.int8, "rows", ()),
    }
    texts: ClassVar = {"ids": "feature_id", "extras": "extras", **{name: name for name in ID_LISTS}}
    lists = ID_LISTS
    _points: ClassVar = {"polyline": 3, "polygon": 3, "width": 2}

    def __getitem__(self, field: str) -> Any:
        if field in self._points:
            offsets, width = self.array(f"{field}_offsets", self.length + 1), self._points[field]
            return Ragged(offsets, self.array(field, offsets.item(-1), width))
        return super().__getitem__(field)


def check_points(columns: Columns, names: tuple[str, ...]) -> None:
    """Raise unless the lists of all coordinates of points have the same lengths; all but the first may be null.

    Args:
        columns: Rows of the maps table.
        names: Columns of coordinates.

    Raises:
        LakeError: They have not: the file is damaged.
    """
    places, likes = columns.layout.places(names), columns.layout.places(tuple(_FIRST_AXES[name] for name in names))
    bounds = np.array([0, columns.num_rows])
    differs = check_lengths(columns.block, likes, places, np.full(len(names), OR_NONE), bounds)
    if differs < len(names):
        raise StoredFeatures.damage(names[differs])
