"""Build canonical map features from columns with one value or one list per feature."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from itertools import chain
from operator import itemgetter
from typing import Any

import numpy as np
import numpy.typing as npt

from scenarionet_data.arrays.dtypes import Array, Bool, Float64
from scenarionet_data.arrays.ragged import Ragged
from scenarionet_data.building.tracks import METRES, WIDTHS, rounded
from scenarionet_data.errors import BadParameter
from scenarionet_data.scenario.canonical_json import to_json
from scenarionet_data.scenario.defects import Defect
from scenarionet_data.scenario.description import ID_LISTS, MapFeatures, strings
from scenarionet_data.scenario.vocabulary import MapFeatureType


def make_features(
    ids: Iterable[Any],
    types: npt.ArrayLike,
    *,
    polyline: Ragged,
    polygon: Ragged,
    width: Ragged,
    speed_limit: npt.ArrayLike,
    links: Mapping[str, Ragged],
    is_intersection: npt.ArrayLike,
    extras: Sequence[str | None],
    origin: Float64,
    has_z: bool,
) -> MapFeatures:
    """Build map features as float32 offsets from ``origin``.

    Args:
        ids: (M,) unique within the map.
        types: (M,) codes of ``MapFeatureType``.
        polyline, polygon: M lists of points (P, 3) float64 [m], source frame.
        width: M lists of (k, 2) [m] from the centreline to the left and right side; k is 0, 1 or the number of points.
        speed_limit: (M,) [m/s], NaN when unknown.
        links: M lists of ids by name in ``ID_LISTS``; missing names are empty lists.
        is_intersection: (M,) 1 yes, 0 no, -1 unknown.
        extras: (M,) JSON text or None.
        origin: (3,) float64 [m].
        has_z: If False, every z is set to 0.
    """

    def offsets(points: Ragged) -> Ragged:
        values = points.values - origin
        if not has_z:
            values[:, 2] = 0.0
        return Ragged(points.offsets, rounded(values, METRES))

    codes = np.asarray(types, dtype=np.uint8)
    none = Ragged.empty(len(codes))
    # Widths given per point are rounded, a lane's single width is kept exactly.
    is_one_for_all = np.repeat(width.lengths == 1, width.lengths)[:, None]
    exact = width.values.astype(np.float32)
    return MapFeatures(
        ids=strings(ids),
        feature_type=codes,
        polyline=offsets(polyline),
        polygon=offsets(polygon),
        speed_limit=np.asarray(speed_limit, dtype=np.float32),
        width=Ragged(width.offsets, np.where(is_one_for_all, exact, rounded(width.values, WIDTHS))),
        **(dict.fromkeys(ID_LISTS, none) | dict(links)),
        is_intersection=np.asarray(is_intersection, dtype=np.int8),
        extras=np.array(extras, dtype=object),
    )


def flat_points(lines: Sequence[Any], height: float = 0.0) -> Ragged:
    """Return lines as M lists of points (P, 3) float64 [m]; batched, as a NumPy call costs the same for one as for all.

    Args:
        lines: (M,) each None, empty, or (n, 2) or (n, 3) as an array or as a list of points.
        height: z of 2D points.

    Raises:
        ValueError: Points have neither 2 nor 3 coordinates, or a line mixes both.
    """
    lengths = np.array([0 if line is None else len(line) for line in lines], np.int64)
    forms: dict[tuple[bool, int], list[int]] = {}
    for row in np.flatnonzero(lengths).tolist():
        is_array = isinstance(lines[row], np.ndarray)
        form = is_array, lines[row].shape[1] if is_array else len(lines[row][0])
        forms.setdefault(form, []).append(row)
    points = np.zeros((int(lengths.sum()), 3))
    points[:, 2] = height
    for (is_array, width), rows in forms.items():
        if width not in (2, 3):
            raise ValueError(f"expected points with 2 or 3 coordinates, found {width}")
        chosen = [lines[row] for row in rows]
        values = np.concatenate(chosen) if is_array else _stacked(chosen, width)
        if len(forms) == 1:
            points[:, :width] = values
        else:
            is_of_form = np.zeros(len(lines), np.bool_)
            is_of_form[rows] = True
            points[np.repeat(is_of_form, lengths), :width] = values
    return Ragged.from_flat(lengths, points)


def _stacked(lines: Sequence[Sequence[Sequence[float]]], width: int) -> Float64:
    """Concatenate lists of points to (P, width); twice as fast as letting NumPy infer the shape."""
    points = list(chain.from_iterable(lines))
    if set(map(len, points)) != {width}:
        raise ValueError(f"expected {width} coordinates for every point, as for the first")
    return np.fromiter(chain.from_iterable(points), np.float64, width * len(points)).reshape(-1, width)


_NO_POINTS, _NO_WIDTHS = np.zeros((0, 3)), np.zeros((0, 2))
_COLUMNS = ("id", "type", "polyline", "polygon", "speed_limit", "width", *ID_LISTS, "is_intersection", "extras")


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
        if not isinstance(feature_type, int | np.integer):
            raise BadParameter(f"feature_type={feature_type!r}; expected one such as MapFeatureType.CROSSWALK")
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
        boxes = np.full((len(self), 4), np.nan)
        for row, feature in enumerate(self._rows):
            points = np.concatenate([feature["polyline"], feature["polygon"]])[:, :2]
            if len(points):
                boxes[row] = *points.min(axis=0), *points.max(axis=0)
        return boxes

    @property
    def has_heights(self) -> bool:
        """Whether any point has a z other than 0."""
        return any(feature[name][:, 2].any() for feature in self._rows for name in ("polyline", "polygon"))

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
        chosen._rows = [self._rows[row] for row in rows.tolist()]
        return chosen

    def build(self, origin: Float64, has_z: bool = True) -> MapFeatures:
        """Build the features as float32 offsets from ``origin``; z is 0 unless ``has_z``."""
        columns = {name: list(map(itemgetter(name), self._rows)) for name in _COLUMNS}

        def lists(name: str, none: Float64) -> Ragged:
            return Ragged.from_flat(list(map(len, columns[name])), np.concatenate([none, *columns[name]]))

        return make_features(
            columns["id"],
            columns["type"],
            polyline=lists("polyline", _NO_POINTS),
            polygon=lists("polygon", _NO_POINTS),
            width=lists("width", _NO_WIDTHS),
            speed_limit=columns["speed_limit"],
            links={name: Ragged.from_ids(columns[name]) for name in ID_LISTS},
            is_intersection=columns["is_intersection"],
            extras=columns["extras"],
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
