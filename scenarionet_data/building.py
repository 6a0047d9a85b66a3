"""Makes the canonical arrays of a scenario from what a source holds: converters call these, nothing else does.

Canonical means: float32 offsets from the origin, headings wrapped, zeros where not valid, ids as str.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from scenarionet_data import canonical
from scenarionet_data.geometry import wrap_angle
from scenarionet_data.jsontext import to_json
from scenarionet_data.ragged import Ragged
from scenarionet_data.scenario import Bool, Float32, Float64, MapFeatures, Tracks, strings
from scenarionet_data.vocabulary import MapFeatureType

METRES = 2.0**-14
"""Positions and speeds are multiples of this: 0.06 mm, what float32 resolves half a kilometre from the origin."""

WIDTHS = 2.0**-10
"""Lane widths given point by point are multiples of this: 1 mm."""

RADIANS = 2.0**-20
"""Headings are multiples of this: a millionth of a radian."""

_STEPS = np.array([METRES, RADIANS], np.float32)
_PI = np.float32(np.pi)
_BELOW_PI = np.nextafter(_PI, np.float32(0.0))


def rounded(values: npt.ArrayLike, step: float) -> npt.NDArray[np.float32]:
    """Values to the nearest multiple of ``step``, as float32.

    A recorder's noise below that would fill a fifth of the lake with digits nobody measured.
    """
    with np.errstate(over="ignore"):  # beyond float32 becomes infinite, which validation names
        array = np.array(values, dtype=np.float32)
        array *= np.float32(1.0 / step)  # a power of two: exact
        np.rint(array, out=array)
        array *= np.float32(step)
    return array


def make_origin(position: npt.NDArray[Any], valid: Bool, has_z: bool) -> Float64:
    """Origin of a scenario: the ego's first valid position rounded to whole metres.

    Args:
        position: (T, 3) of the ego in the source frame [m].
        valid: (T,).
        has_z: Without heights the origin's z is 0.

    Returns:
        (3,) float64 [m].
    """
    first = np.round(np.asarray(position, dtype=np.float64)[int(np.argmax(valid))])
    return np.array([first[0], first[1], first[2] if has_z else 0.0], dtype=np.float64) + 0.0


def offsets_from(origin: Float64, points: npt.NDArray[Any]) -> Float32:
    """Points (..., 3) as float32 offsets, subtracted in float64 without a float64 copy of all of them."""
    offsets = np.empty(points.shape, np.float32)
    with np.errstate(over="ignore"):  # beyond float32 becomes infinite, which validation names
        np.subtract(points, origin, out=offsets, casting="same_kind")
    return offsets


def make_tracks(
    ids: Sequence[str],
    object_type: npt.ArrayLike,
    position: npt.NDArray[Any],
    heading: npt.NDArray[Any],
    velocity: npt.NDArray[Any],
    size: npt.NDArray[Any],
    valid: npt.NDArray[Any],
    *,
    origin: Float64,
    source_type: Sequence[str | None] | None = None,
    is_size_assumed: npt.ArrayLike = False,
    is_type_assumed: npt.ArrayLike = False,
    is_velocity_estimated: npt.ArrayLike = False,
    extras: Sequence[Mapping[str, Any] | None] | None = None,
) -> Tracks:
    """Tracks in canonical form from arrays in the source frame.

    Args:
        ids: (N,).
        object_type: (N,) codes of ``ObjectType``.
        position: (N, T, 3) float64 [m], source frame.
        heading: (N, T) [rad], any turn.
        velocity: (N, T, 2) [m/s].
        size: (N, T, 3) or (N, 3) [m] length, width, height.
        valid: (N, T); values elsewhere are dropped, whatever they are.
        origin: (3,) float64 [m].
        source_type: (N,) the source's own words.
        is_size_assumed, is_type_assumed, is_velocity_estimated: (N,) or one bool for all.
        extras: (N,) JSON-able mappings.
    """
    valid = np.ascontiguousarray(valid, dtype=np.bool_)
    shapes = [(*valid.shape, 3), valid.shape, (*valid.shape, 2)]
    source = [
        np.ascontiguousarray(np.broadcast_to(values, shape), np.float64)
        for values, shape in zip((position, heading, velocity), shapes, strict=True)
    ]
    poses = tuple(np.zeros(shape, np.float32) for shape in shapes)
    canonical.fill_poses(source[0], source[1], source[2], valid, origin, _STEPS, poses)
    return Tracks(
        position=poses[0],
        heading=poses[1],
        velocity=poses[2],
        size=_sizes(np.asarray(size), valid),
        valid=valid,
        **_said(ids, object_type, source_type, is_size_assumed, is_type_assumed, is_velocity_estimated, extras),
    )


def make_tracks_of_rows(
    ids: Sequence[str],
    object_type: npt.ArrayLike,
    position: npt.NDArray[Any],
    heading: npt.NDArray[Any],
    velocity: npt.NDArray[Any],
    size: npt.NDArray[Any],
    track: npt.NDArray[Any],
    timestep: npt.NDArray[Any],
    num_timesteps: int,
    *,
    origin: Float64,
    source_type: Sequence[str | None] | None = None,
    is_size_assumed: npt.ArrayLike = False,
    is_type_assumed: npt.ArrayLike = False,
    is_velocity_estimated: npt.ArrayLike = False,
    extras: Sequence[Mapping[str, Any] | None] | None = None,
) -> Tracks:
    """What :func:`make_tracks` makes, from R rows of one observed state each.

    For sources that list states: when most tracks are short, arithmetic on the whole grid of tracks and timesteps
    would be spent on nothing.

    Args:
        ids, object_type, origin, source_type, extras: As there.
        is_size_assumed, is_type_assumed, is_velocity_estimated: As there.
        position: (R, 3) float64 [m], source frame.
        heading: (R,) [rad], any turn.
        velocity: (R, 2) [m/s].
        size: (R, 3) [m] length, width, height.
        track, timestep: (R,) where each row stands; no two stand in one place.
        num_timesteps: T.
    """
    shape = (len(ids), num_timesteps)

    def grid(rows: npt.NDArray[Any]) -> npt.NDArray[Any]:
        cells = np.zeros((*shape, *rows.shape[1:]), rows.dtype)
        cells[track, timestep] = rows
        return cells

    return Tracks(
        position=grid(_canonical(offsets_from(origin, position), METRES)),
        heading=grid(np.clip(_canonical(wrap_angle(heading), RADIANS), -_PI, _BELOW_PI)),
        velocity=grid(_canonical(velocity, METRES)),
        size=grid(_row_sizes(size, track, len(ids))),
        valid=grid(np.ones(len(track), np.bool_)),
        **_said(ids, object_type, source_type, is_size_assumed, is_type_assumed, is_velocity_estimated, extras),
    )


def _said(
    ids: Sequence[str],
    object_type: npt.ArrayLike,
    source_type: Sequence[str | None] | None,
    is_size_assumed: npt.ArrayLike,
    is_type_assumed: npt.ArrayLike,
    is_velocity_estimated: npt.ArrayLike,
    extras: Sequence[Mapping[str, Any] | None] | None,
) -> dict[str, Any]:
    """The fields of tracks that are one value each."""
    count = len(ids)
    none = np.full(count, None, dtype=object)
    return {
        "ids": strings(ids),
        "object_type": np.asarray(object_type, dtype=np.uint8),
        "source_type": none if source_type is None else np.array(source_type, dtype=object),
        "is_size_assumed": _flags(is_size_assumed, count),
        "is_type_assumed": _flags(is_type_assumed, count),
        "is_velocity_estimated": _flags(is_velocity_estimated, count),
        "extras": none if extras is None else np.array([to_json(e) for e in extras], dtype=object),
    }


def _canonical(values: npt.ArrayLike, step: float) -> npt.NDArray[np.float32]:
    """Rounded, without negative zeros."""
    kept = rounded(values, step)
    kept += np.float32(0.0)
    return kept


def _sizes(size: npt.NDArray[Any], valid: Bool) -> npt.NDArray[np.float32]:
    """Sizes of an object that never changes stay as they are given; those measured at every step are rounded."""
    size = np.broadcast_to(size[:, None, :] if size.ndim == 2 else size, (*valid.shape, 3))
    sizes = np.zeros(size.shape, np.float32)
    with np.errstate(over="ignore"):  # beyond float32 becomes infinite, which validation names
        canonical.fill_sizes(np.ascontiguousarray(size, np.float32), valid, np.float32(METRES), sizes)
    return sizes


def _row_sizes(size: npt.NDArray[Any], track: npt.NDArray[Any], count: int) -> npt.NDArray[np.float32]:
    """As :func:`_sizes`, of rows (R, 3) of ``count`` objects."""
    with np.errstate(over="ignore"):
        exact = size.astype(np.float32)
    some_row, changing = np.zeros(count, np.int64), np.zeros(count, np.bool_)
    some_row[track] = np.arange(len(track))
    changing[track[(exact != exact[some_row[track]]).any(axis=1)]] = True
    return np.where(changing[track][:, None], rounded(exact, METRES), exact)


def _flags(values: npt.ArrayLike, count: int) -> Bool:
    return np.array(np.broadcast_to(np.asarray(values, dtype=np.bool_), (count,)))


class MapBuilder:
    """Collects map features one by one, in the source frame, and makes :class:`MapFeatures` of them.

    Example:
        >>> builder = MapBuilder()
        >>> builder.add("7", MapFeatureType.LANE_SURFACE_STREET, polyline=[[5.0, 0.0], [9.0, 0.0]])
        >>> builder.build(np.array([5.0, 0.0, 0.0])).polyline[0].tolist()
        [[0.0, 0.0, 0.0], [4.0, 0.0, 0.0]]
    """

    def __init__(self) -> None:
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
            feature_id: Unique in the map.
            feature_type: What it is.
            polyline, polygon: (n, 2) or (n, 3) [m], source frame.
            speed_limit: [m/s].
            width: (2,) or (n, 2) [m] from the centreline to the left and right side.
            entry_lanes, exit_lanes, left_neighbors, right_neighbors: Ids of lanes.
            left_boundaries, right_boundaries: Ids of lines and edges.
            controlled_lanes: Ids of lanes a stop sign, stop line or crosswalk applies to.
            is_intersection: None when the source does not say.
            extras: JSON-able.
        """
        self._rows.append(
            {
                "id": str(feature_id),
                "type": int(feature_type),
                "polyline": _points(polyline),
                "polygon": _points(polygon),
                "speed_limit": speed_limit,
                "width": np.zeros((0, 2)) if width is None else np.asarray(width, np.float64).reshape(-1, 2),
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
        """(M, 4) min_x, min_y, max_x, max_y [m] of each feature in the source frame; NaN without geometry."""
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
        """The features, whole, whose bounding box meets a window.

        Args:
            window: min_x, min_y, max_x, max_y [m] in the source frame.
            bounds: :attr:`bounds`, when it is at hand: a city is cropped many times.
        """
        boxes = self.bounds if bounds is None else bounds
        return self.take(np.flatnonzero(meets(boxes, window)))

    def take(self, rows: npt.NDArray[Any]) -> MapBuilder:
        """The features at ``rows``, in that order."""
        chosen = MapBuilder()
        chosen._rows = [self._rows[row] for row in rows]
        return chosen

    def build(self, origin: Float64, has_z: bool = True) -> MapFeatures:
        """The features as float32 offsets from ``origin``; z is 0 without ``has_z``."""
        rows = self._rows

        def column(name: str) -> list[Any]:
            return [row[name] for row in rows]

        def geometry(name: str) -> Ragged:
            lists = column(name)
            values = np.concatenate([np.zeros((0, 3)), *lists]) - origin
            if not has_z:
                values[:, 2] = 0.0
            return Ragged.from_flat([len(points) for points in lists], rounded(values, METRES))

        def widths() -> Ragged:
            lists = column("width")
            return Ragged.from_flat(
                [len(w) for w in lists], rounded(np.concatenate([np.zeros((0, 2)), *lists]), METRES)
            )

        return MapFeatures(
            ids=strings(column("id")),
            types=np.array(column("type"), dtype=np.uint8),
            polyline=geometry("polyline"),
            polygon=geometry("polygon"),
            speed_limit=np.array(column("speed_limit"), dtype=np.float32),
            width=Ragged.from_lists([w if len(w) == 1 else rounded(w, WIDTHS) for w in column("width")], width=2),
            entry_lanes=Ragged.from_ids(column("entry_lanes")),
            exit_lanes=Ragged.from_ids(column("exit_lanes")),
            left_neighbors=Ragged.from_ids(column("left_neighbors")),
            right_neighbors=Ragged.from_ids(column("right_neighbors")),
            left_boundaries=Ragged.from_ids(column("left_boundaries")),
            right_boundaries=Ragged.from_ids(column("right_boundaries")),
            controlled_lanes=Ragged.from_ids(column("controlled_lanes")),
            is_intersection=np.array(column("is_intersection"), dtype=np.int8),
            extras=np.array(column("extras"), dtype=object),
        )


def meets(boxes: Float64, window: tuple[float, float, float, float]) -> Bool:
    """(M,) which boxes (M, 4) touch or overlap a window, both as min_x, min_y, max_x, max_y; never for NaN."""
    min_x, min_y, max_x, max_y = window
    return (boxes[:, 0] <= max_x) & (boxes[:, 2] >= min_x) & (boxes[:, 1] <= max_y) & (boxes[:, 3] >= min_y)


def _points(points: npt.ArrayLike | None) -> Float64:
    """(n, 3) float64, z = 0 for points in the plane."""
    if points is None or not np.size(points):
        return np.zeros((0, 3))
    array = np.asarray(points, dtype=np.float64)
    if array.shape[-1] == 2:
        array = np.concatenate([array, np.zeros((len(array), 1))], axis=1)
    return array.reshape(-1, 3)
