"""Build a map incrementally from single features."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from scenarionet_data.arrays.dtypes import Array, Bool, Float64
from scenarionet_data.arrays.ragged import Ragged
from scenarionet_data.building.features import make_features
from scenarionet_data.scenario.canonical_json import to_json
from scenarionet_data.scenario.defects import Defect
from scenarionet_data.scenario.description import ID_LISTS, MapFeatures
from scenarionet_data.scenario.vocabulary import MapFeatureType

_NO_POINTS, _NO_WIDTHS = np.zeros((0, 3)), np.zeros((0, 2))


class MapBuilder:
    """Collects map features in the source frame and builds :class:`MapFeatures` from them.

    Attributes:
        defects: What the conversion of a shared map dropped or assumed.

    Example:
        >>> builder = MapBuilder()
        >>> builder.add("7", MapFeatureType.LANE_SURFACE_STREET, polyline=[[5.0, 0.0], [9.0, 0.0]])
        >>> builder.build(np.array([5.0, 0.0, 0.0])).polyline[0].tolist()
        [[0.0, 0.0, 0.0], [4.0, 0.0, 0.0]]
    """

    def __init__(self) -> None:
        self.defects: tuple[Defect, ...] = ()
        self._rows: list[dict[str, Any]] = []

    def __len__(self) -> int:
        return len(self._rows)

    def add(
        self,
        feature_id: str,
        feature_type: MapFeatureType,
        *,
        polyline: npt.ArrayLike | None = None,
        polygon: npt.ArrayLike | None = None,
        speed_limit: float = np.nan,
        width: npt.ArrayLike | None = None,
        entry_lanes: Sequence[str] = (),
        exit_lanes: Sequence[str] = (),
        left_neighbors: Sequence[str] = (),
        right_neighbors: Sequence[str] = (),
        left_boundaries: Sequence[str] = (),
        right_boundaries: Sequence[str] = (),
        controlled_lanes: Sequence[str] = (),
        is_intersection: bool | None = None,
        extras: Mapping[str, Any] | None = None,
    ) -> None:
        """Add one feature.

        Args:
            feature_id: Unique within the map.
            feature_type: Its type.
            polyline, polygon: (n, 2) or (n, 3) [m], source frame.
            speed_limit: [m/s].
            width: (2,) or (n, 2) [m] from the centreline to the left and right side.
            entry_lanes, exit_lanes, left_neighbors, right_neighbors: Ids of lanes.
            left_boundaries, right_boundaries: Ids of lines and edges.
            controlled_lanes: Ids of the lanes that a stop sign, stop line or crosswalk applies to.
            is_intersection: None if unknown.
            extras: JSON-serialisable.
        """
        self._rows.append(
            {
                "id": str(feature_id),
                "type": int(feature_type),
                "polyline": _points(polyline),
                "polygon": _points(polygon),
                "speed_limit": speed_limit,
                "width": _NO_WIDTHS if width is None else np.asarray(width, np.float64).reshape(-1, 2),
                "entry_lanes": entry_lanes,
                "exit_lanes": exit_lanes,
                "left_neighbors": left_neighbors,
                "right_neighbors": right_neighbors,
                "left_boundaries": left_boundaries,
                "right_boundaries": right_boundaries,
                "controlled_lanes": controlled_lanes,
                "is_intersection": -1 if is_intersection is None else int(is_intersection),
                "extras": to_json(extras),
            }
        )

    @property
    def bounds(self) -> Float64:
        """(M, 4) min_x, min_y, max_x, max_y [m] of each feature in the source frame; NaN if it has no geometry."""
        boxes = np.full((len(self._rows), 4), np.nan)
        for row, feature in enumerate(self._rows):
            points = np.concatenate([feature["polyline"], feature["polygon"]])[:, :2]
            if len(points):
                boxes[row] = *points.min(axis=0), *points.max(axis=0)
        return boxes

    @property
    def has_heights(self) -> bool:
        """Whether any point has a z other than 0."""
        return any(f["polyline"][:, 2].any() or f["polygon"][:, 2].any() for f in self._rows)

    def crop(self, window: tuple[float, float, float, float], bounds: Float64 | None = None) -> MapBuilder:
        """Return the features, uncut, whose bounding box overlaps a window.

        Args:
            window: min_x, min_y, max_x, max_y [m] in the source frame.
            bounds: :attr:`bounds`, if already computed; a city map is cropped many times.
        """
        boxes = self.bounds if bounds is None else bounds
        return self.take(np.flatnonzero(meets(boxes, window)))

    def take(self, rows: Array) -> MapBuilder:
        """Return the features at ``rows``, in that order."""
        chosen = MapBuilder()
        chosen._rows = [self._rows[row] for row in rows]
        return chosen

    def build(self, origin: Float64, has_z: bool = True) -> MapFeatures:
        """Build the features as float32 offsets from ``origin``; z is 0 unless ``has_z``."""
        rows = self._rows

        def column(name: str) -> list[Any]:
            return [row[name] for row in rows]

        def lists(name: str, none: Float64) -> Ragged:
            found = column(name)
            return Ragged.from_flat([len(each) for each in found], np.concatenate([none, *found]))

        return make_features(
            column("id"),
            column("type"),
            polyline=lists("polyline", _NO_POINTS),
            polygon=lists("polygon", _NO_POINTS),
            width=lists("width", _NO_WIDTHS),
            speed_limit=column("speed_limit"),
            links={name: Ragged.from_ids(column(name)) for name in ID_LISTS},
            is_intersection=column("is_intersection"),
            extras=column("extras"),
            origin=origin,
            has_z=has_z,
        )


def meets(boxes: Float64, window: tuple[float, float, float, float]) -> Bool:
    """(M,) whether boxes (M, 4) overlap a window, both as min_x, min_y, max_x, max_y; False for NaN."""
    min_x, min_y, max_x, max_y = window
    return (boxes[:, 0] <= max_x) & (boxes[:, 2] >= min_x) & (boxes[:, 1] <= max_y) & (boxes[:, 3] >= min_y)


def _points(points: npt.ArrayLike | None) -> Float64:
    """(n, 3) float64 points, with z = 0 for 2D points."""
    if points is None:
        return _NO_POINTS
    array = np.asarray(points, dtype=np.float64)
    if not array.size:
        return _NO_POINTS
    if array.ndim == 2 and array.shape[1] == 3:
        return array
    if array.shape[-1] == 2:
        array = np.concatenate([array, np.zeros((len(array), 1))], axis=1)
    return array.reshape(-1, 3)
