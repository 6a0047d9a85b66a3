"""Decode Lyft's ``semantic_map.pb``, one ``MapFragment`` message, into arrays in the source's frames and codes.

Field numbers are those of ``l5kit/data/proto/road_network.proto`` in woven-planet/l5kit. ``map_features`` maps values
to the lake's vocabulary; ``protowire`` decodes bytes.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
import numpy.typing as npt

from scenarionet_data.arrays.dtypes import Bool, Float64, Int64, UInt64
from scenarionet_data.arrays.ragged import Ragged
from scenarionet_data.converters.formats.protowire import DamagedMessage, Fields, Messages, enums, floats
from scenarionet_data.errors import CorruptSource

SEMI_MAJOR_AXIS = 6_378_137.0
"""Semi-axes of the WGS 84 ellipsoid [m]."""
FLATTENING = 1.0 / 298.257223563
_SQUARED_ECCENTRICITY = FLATTENING * (2.0 - FLATTENING)


def on_ellipsoid(latitude: Float64, longitude: Float64) -> Float64:
    """Return the earth-centred, earth-fixed coordinates of points of height 0 (EPSG 9602).

    Args:
        latitude, longitude: (K,) geodetic [rad].

    Returns:
        (K, 3) [m].

    Example:
        >>> on_ellipsoid(np.zeros(1), np.zeros(1)).tolist()
        [[6378137.0, 0.0, 0.0]]
    """
    normal = SEMI_MAJOR_AXIS / np.sqrt(1.0 - _SQUARED_ECCENTRICITY * np.sin(latitude) ** 2)
    scale = np.stack([normal, normal, normal * (1.0 - _SQUARED_ECCENTRICITY)], axis=-1)
    return scale * _axes(latitude, longitude)[:, 2]


def local_to_earth(points: Float64, latitude: Float64, longitude: Float64) -> Float64:
    """Transform east, north, up [m] (P, 3), with an origin of height 0 per point, to earth-centred coordinates.

    Args:
        points: (P, 3).
        latitude, longitude: (P,) geodetic coordinates of the origins [rad].
    """
    origin, axes = on_ellipsoid(latitude, longitude), _axes(latitude, longitude)
    turned: Float64 = origin + np.einsum("pi,pij->pj", points, axes)
    return turned


def _axes(latitude: Float64, longitude: Float64) -> Float64:
    """(K, 3, 3) unit vectors east, north and up."""
    sin_lat, cos_lat, sin_lng, cos_lng = np.sin(latitude), np.cos(latitude), np.sin(longitude), np.cos(longitude)
    east = np.stack([-sin_lng, cos_lng, np.zeros_like(latitude)], axis=-1)
    north = np.stack([-sin_lat * cos_lng, -sin_lat * sin_lng, cos_lat], axis=-1)
    up = np.stack([cos_lat * cos_lng, cos_lat * sin_lng, sin_lat], axis=-1)
    return np.stack([east, north, up], axis=1)


T = TypeVar("T")

_SEGMENT, _LANE, _CONTROL, _JUNCTION = 1, 3, 4, 5
"""Kinds of map elements, by field number in MapElement.Element."""
_MAX_DAMAGED = 0.2
"""Share of damaged elements above which a map cannot be used."""
_CONTROL_DATA = (2, 3, 4, 5, 6, 48)
"""Fields of a TrafficControlElement other than its kind."""


@dataclass(frozen=True, eq=False)
class WireSide:
    """One side of each of L lanes.

    Attributes:
        lines: Points (P, 3) in earth-centred coordinates [m]; fewer than two if the lane has no geometry.
        dividers: Kinds of paint along each lane, from its first point.
        changes: Arc lengths at which the kind changes [m], per lane.
    """

    lines: Ragged
    dividers: list[list[int]]
    changes: list[list[float]]


@dataclass(frozen=True, eq=False)
class WireLanes:
    """L lanes.

    Attributes:
        ids: Their ids.
        parents: Segment or junction of each, "" for none.
        left, right: Their sides.
        ahead: Ids of successors.
        left_neighbors, right_neighbors: Ids of lanes to change to, "" for none.
        controls: Ids of the traffic controls at the exit.
        access, orientations, turns: (L,) int64 AccessRestriction.Type, TravelDirection, TurnType.
        can_have_parked_cars: (L,) bool.
    """

    ids: list[str]
    parents: list[str]
    left: WireSide
    right: WireSide
    ahead: list[list[str]]
    left_neighbors: list[str]
    right_neighbors: list[str]
    controls: list[list[str]]
    access: Int64
    orientations: Int64
    turns: Int64
    can_have_parked_cars: Bool


@dataclass(frozen=True, eq=False)
class WireControls:
    """E traffic controls: lights, their faces, signs, crosswalks.

    Attributes:
        ids: Their ids.
        kinds: (E,) int64 field number of the kind, 0 for none.
        points: Points (P, 3) in earth-centred coordinates [m]; the frame's origin if it has none.
        faces: Ids of a traffic light's faces.
    """

    ids: list[str]
    kinds: Int64
    points: Ragged
    faces: list[list[str]]


@dataclass(frozen=True, eq=False)
class LyftWireMap:
    """The relevant parts of a MapFragment.

    Attributes:
        lanes, controls: As above.
        segments: Speed limit forwards and backwards [m/s] (0 if unknown) and RoadClass, by id.
        junctions: Whether it is a real intersection, by id.
        damaged: Numbers of the elements that cannot be decoded, and were left out, each with the reason.
        repeated: Ids of elements that an earlier one has, left out as well.
    """

    lanes: WireLanes
    controls: WireControls
    segments: dict[str, tuple[float, float, int]]
    junctions: dict[str, bool]
    damaged: tuple[tuple[int, str], ...] = ()
    repeated: tuple[str, ...] = ()


def read_map(path: Path) -> LyftWireMap:
    """Read a semantic map, without the elements that cannot be decoded.

    Raises:
        CorruptSource: The file is missing, not such a message, or more than one in five elements cannot be decoded.
    """
    try:
        elements = Messages.of(path.read_bytes()).fields().parts(2)
    except OSError as error:
        raise CorruptSource(f"{path}: cannot be read ({error.strerror}); download it again") from error
    except DamagedMessage as error:
        raise CorruptSource(f"{path}: expected Lyft's semantic map, found {error}; download it again") from error
    damaged: list[tuple[int, str]] = []
    try:
        found = _decode(elements)
    except ValueError as error:
        damaged = _damaged(elements)
        if len(damaged) > len(elements) * _MAX_DAMAGED:
            share = f"{len(damaged):,} of {len(elements):,} elements damaged"
            raise CorruptSource(f"{path}: expected Lyft's semantic map, found {share}; download it again") from error
        elements = elements[np.delete(np.arange(len(elements)), [number for number, _ in damaged])]
        found = _decode(elements)
    names = _single_ids(elements.fields(), 1, len(elements))
    _, first = np.unique(names, return_index=True)
    repeated = [names[row] for row in np.delete(np.arange(len(names)), first)]
    if repeated:
        found = _decode(elements[np.sort(first)])
    if not found.lanes.ids:
        raise CorruptSource(f"{path}: expected Lyft's semantic map, found no lanes in it; download it again")
    return replace(found, damaged=tuple(damaged), repeated=tuple(repeated))


def _damaged(elements: Messages) -> list[tuple[int, str]]:
    """Numbers of the elements that cannot be decoded, found by halving, each with the reason."""
    waiting, found = [np.arange(len(elements))], list[tuple[int, str]]()
    while waiting and len(found) <= len(elements) * _MAX_DAMAGED:
        rows = waiting.pop()
        try:
            _decode(elements[rows])
        except ValueError as error:
            if len(rows) == 1:
                found.append((int(rows[0]), "no text" if isinstance(error, UnicodeError) else str(error)))
            else:
                waiting += [rows[len(rows) // 2 :], rows[: len(rows) // 2]]
    return found


def _decode(elements: Messages) -> LyftWireMap:
    """Decode some elements.

    Raises:
        ValueError: One of them is damaged.
    """
    count = len(elements)
    fields = elements.fields()
    ids = _single_ids(fields, 1, count)
    if "" in ids:
        raise ValueError("an element without an id")
    bodies = fields.parts(2)
    inside = bodies.fields()

    def part(number: int) -> tuple[Messages, list[str]]:
        messages = inside.parts(number)
        return messages, [ids[row] for row in bodies.owner[messages.owner]]

    junctions, names = part(_JUNCTION)
    is_real = (junctions.scalars("---v")[:, 3] > 0).tolist()
    return LyftWireMap(
        lanes=_lanes(*part(_LANE)),
        controls=_controls(*part(_CONTROL)),
        segments=_segments(*part(_SEGMENT)),
        junctions=dict(zip(names, is_real, strict=True)),
    )


def _lanes(messages: Messages, ids: list[str]) -> WireLanes:
    count, fields = len(messages), messages.fields()
    origins = _origins(fields, 2, count)
    restriction = fields.parts(11)
    access = np.zeros(count, np.int64)
    access[restriction.owner] = enums(restriction.scalars("v")[:, 0], 6)
    return WireLanes(
        ids=ids,
        parents=_single_ids(fields, 1, count),
        left=_side(fields, 3, origins),
        right=_side(fields, 4, origins),
        ahead=_id_lists(fields, 5, count),
        left_neighbors=_single_ids(fields, 6, count),
        right_neighbors=_single_ids(fields, 7, count),
        controls=_id_lists(fields, 8, count),
        access=access,
        orientations=enums(fields.column(12, "v", count), 5),
        turns=enums(fields.column(13, "v", count), 7),
        can_have_parked_cars=fields.column(10, "v", count) > 0,
    )


def _side(fields: Fields, number: int, origins: Float64) -> WireSide:
    """Sides of the lanes of ``fields``, in frames with ``origins`` (L, 2)."""
    count = len(origins)
    boundaries = fields.parts(number)
    inside = boundaries.fields()
    kind_owner, kinds = inside.lists(4, "v")
    change_owner, changes = inside.lists(5, "v")
    metres = changes.astype(np.int64) / 100.0
    return WireSide(
        lines=_points(inside, (1, 2, 3), boundaries.owner, origins),
        dividers=_grouped(boundaries.owner[kind_owner], enums(kinds, 13).tolist(), count),
        changes=_grouped(boundaries.owner[change_owner], metres.tolist(), count),
    )


def _controls(messages: Messages, ids: list[str]) -> WireControls:
    count, fields = len(messages), messages.fields()
    kinds = np.zeros(count, np.int64)
    is_kind = fields.is_part & ~np.isin(fields.number, _CONTROL_DATA)
    kinds[fields.owner[is_kind]] = fields.number[is_kind]
    origins = _origins(fields, 2, count)
    points = _points(fields, (3, 4, 5), np.arange(count), origins)
    (bare,) = np.nonzero(points.lengths == 0)
    places = local_to_earth(np.zeros((len(bare), 3)), *origins[bare].T)
    lights = fields.parts(29)
    faces: list[list[str]] = [[] for _ in ids]
    for row, names in zip(lights.owner.tolist(), _id_lists(lights.fields(), 3, len(lights)), strict=True):
        faces[row] += names
    values = np.insert(points.values, points.offsets[bare], places, axis=0)
    lengths = points.lengths.copy()
    lengths[bare] = 1
    return WireControls(ids, kinds, Ragged.from_flat(lengths.tolist(), values), faces)


def _segments(messages: Messages, ids: list[str]) -> dict[str, tuple[float, float, int]]:
    bits = messages.scalars("-----v--ff")
    limits = floats(bits[:, 8:10]).tolist()
    classes = enums(bits[:, 5], 24).tolist()
    return {name: (*limit, kind) for name, limit, kind in zip(ids, limits, classes, strict=True)}


# --- geometry -------------------------------------------------------------------------------------------


def _origins(fields: Fields, number: int, count: int) -> Float64:
    """(count, 2) latitude and longitude [rad] of the frames in one field.

    Altitude and bearing are ignored, as in l5kit (``l5kit/data/map_api.py``).
    """
    frames = fields.parts(number)
    places = frames.fields().parts(1)
    origins = np.zeros((count, 2))
    degrees = places.scalars("ff").astype(np.uint32).view(np.int32) * 1e-7
    origins[frames.owner[places.owner]] = np.radians(degrees)
    return origins


def _points(
    fields: Fields, numbers: tuple[int, int, int], rows: npt.NDArray[np.integer[Any]], origins: Float64
) -> Ragged:
    """Decode points from deltas [cm], for each row of ``origins``.

    Args:
        fields: Fields of m messages.
        numbers: Fields with the deltas in x, y and z, as zigzag integers.
        rows: (m,) row of each message, ascending.
        origins: (K, 2) latitude and longitude of the frames [rad].
    """
    columns = [fields.lists(number, "v") for number in numbers]
    counts = [np.bincount(rows[owner], minlength=len(origins)) for owner, _ in columns]
    if any(not np.array_equal(count, counts[0]) for count in counts):
        raise ValueError("a line with different numbers of x, y and z coordinates")
    lines = Ragged.from_flat(counts[0].tolist(), np.stack([_zigzag(bits) for _, bits in columns], axis=-1))
    travelled = np.cumsum(np.concatenate([np.zeros((1, 3), np.int64), lines.values]), axis=0)
    local = travelled[1:] - np.repeat(travelled[lines.offsets[:-1]], lines.lengths, axis=0)
    latitude, longitude = np.repeat(origins, lines.lengths, axis=0).T
    return Ragged(lines.offsets, local_to_earth(local / 100.0, latitude, longitude))


def _zigzag(bits: UInt64) -> Int64:
    """Decode zigzag integers: 0, 1, 2, 3, ... are 0, -1, 1, -2, ..."""
    values = bits.astype(np.int64)
    return (values >> 1) ^ -(values & 1)


# --- ids ------------------------------------------------------------------------------------------------


def _id_lists(fields: Fields, number: int, count: int) -> list[list[str]]:
    """Ids (GlobalId: UTF-8 bytes in field 1) in one field of each of ``count`` messages."""
    references = fields.parts(number)
    names = references.fields().parts(1)
    texts = [content.decode() for content in names.contents()]
    return _grouped(references.owner[names.owner], texts, count)


def _single_ids(fields: Fields, number: int, count: int) -> list[str]:
    """As :func:`_id_lists`, for a singular field; "" if missing."""
    return [names[-1] if names else "" for names in _id_lists(fields, number, count)]


def _grouped(owner: npt.NDArray[np.integer[Any]], values: list[T], count: int) -> list[list[T]]:
    groups: list[list[T]] = [[] for _ in range(count)]
    for row, value in zip(owner.tolist(), values, strict=True):
        groups[row].append(value)
    return groups
