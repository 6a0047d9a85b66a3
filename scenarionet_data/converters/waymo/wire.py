"""Decode a ``waymo.open_dataset.Scenario`` message into arrays, in the source's frame, units and codes.

Field numbers are those of ``scenario.proto`` and ``map.proto`` in waymo-research/waymo-open-dataset. The package and
``map_features`` map values to the lake's vocabulary; ``protowire`` decodes bytes.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from scenarionet_data.arrays.dtypes import Bool, Float32, Float64, Int64
from scenarionet_data.converters.formats.protowire import (
    DamagedMessage,
    Fields,
    Messages,
    doubles,
    enums,
    floats,
    int32s,
    int64s,
)
from scenarionet_data.errors import InvalidScenario

LANE, ROAD_LINE, ROAD_EDGE, STOP_SIGN, CROSSWALK, SPEED_BUMP, DRIVEWAY = 3, 4, 5, 7, 8, 9, 10
"""Kinds of map features, by field number in MapFeature."""

_KINDS = (LANE, ROAD_LINE, ROAD_EDGE, STOP_SIGN, CROSSWALK, SPEED_BUMP, DRIVEWAY)
_POINTS_FIELD = np.zeros(DRIVEWAY + 1, np.int32)
_POINTS_FIELD[LANE] = 8
_POINTS_FIELD[[ROAD_LINE, ROAD_EDGE, STOP_SIGN]] = 2
_POINTS_FIELD[[CROSSWALK, SPEED_BUMP, DRIVEWAY]] = 1


@dataclass(frozen=True, eq=False)
class WireTracks:
    """N tracks over T steps: those with a state for each step.

    Attributes:
        row: (N,) int64 index of each track in the message.
        ids, types: (N,) int64; 0 for an unknown type.
        is_type_known: (N,) bool.
        center: (N, T, 3) float64 [m].
        size: (N, T, 3) float32 [m] length, width, height.
        heading: (N, T) float32 [rad].
        velocity: (N, T, 2) float32 [m/s].
        valid: (N, T) bool; other arrays are undefined where False.
        total: Number of tracks in the message.
        incomplete: Id and number of states of each track with another number of states than steps.
    """

    row: Int64
    ids: Int64
    types: Int64
    is_type_known: Bool
    center: Float64
    size: Float32
    heading: Float32
    velocity: Float32
    valid: Bool
    total: int
    incomplete: list[tuple[int, int]]


@dataclass(frozen=True, eq=False)
class WireLights:
    """K observations of lanes' lights, in order of time.

    Attributes:
        step, lane, state: (K,) int64; steps may exceed those of the tracks, states are 0 if unknown.
        is_state_known: (K,) bool.
        stop_point: (K, 3) float64 [m], NaN if missing.
    """

    step: Int64
    lane: Int64
    state: Int64
    is_state_known: Bool
    stop_point: Float64


@dataclass(frozen=True, eq=False)
class WaymoWireMap:
    """M map features and the links between them.

    Attributes:
        ids, kinds, types: (M,) int64; ``kinds`` are ``LANE`` ... ``DRIVEWAY``, ``types`` the kind's own enum or 0.
        speed_limit: (M,) float64 [mph], 0 if missing.
        is_interpolating: (M,) bool.
        points: (P, 3) float64 [m] of polyline or polygon, feature after feature.
        num_points: (M,) int64.
        entry_lanes, exit_lanes, controlled_lanes: (K, 2) int64 feature's row, id of the lane.
        left_boundaries, right_boundaries: (K, 5) int64 feature's row, then BoundarySegment:
            lane_start_index, lane_end_index, boundary_feature_id, boundary_type.
        left_neighbors, right_neighbors: (K, 6) int64 feature's row, then LaneNeighbor:
            feature_id, self_start_index, self_end_index, neighbor_start_index, neighbor_end_index.
        left_neighbor_boundaries, right_neighbor_boundaries: (K, 5) int64 neighbour's row, then BoundarySegment.
        num_unknown: Number of features of unknown kind, which are skipped.
    """

    ids: Int64
    kinds: Int64
    types: Int64
    speed_limit: Float64
    is_interpolating: Bool
    points: Float64
    num_points: Int64
    entry_lanes: Int64
    exit_lanes: Int64
    controlled_lanes: Int64
    left_boundaries: Int64
    right_boundaries: Int64
    left_neighbors: Int64
    right_neighbors: Int64
    left_neighbor_boundaries: Int64
    right_neighbor_boundaries: Int64
    num_unknown: int


@dataclass(frozen=True, eq=False)
class WireScenario:
    """A Scenario message.

    Attributes:
        timestamps: (T,) float64 [s].
        current_time_index: 0, protobuf's default, if missing.
        sdc_track_index: -1 if missing.
        objects_of_interest: (K,) int64 track ids.
        tracks_to_predict: (K, 2) int64 track_index, difficulty.
    """

    scenario_id: str
    timestamps: Float64
    current_time_index: int
    sdc_track_index: int
    objects_of_interest: Int64
    tracks_to_predict: Int64
    tracks: WireTracks
    lights: WireLights
    map: WaymoWireMap


def decode(payload: bytes, where: str, identify: Callable[[str], str] = str) -> WireScenario:
    """Decode one message.

    Args:
        payload: The message.
        where: Name of the record in errors until its scenario_id is known.
        identify: Returns the name used in errors for a scenario_id.

    Raises:
        InvalidScenario: Not a Scenario message, damaged, or without times.
    """
    try:
        root = Messages.of(payload)
        fields = root.fields()
        texts = fields.parts(5).contents()
        try:
            scenario_id = texts[-1].decode() if texts else ""
        except UnicodeDecodeError:
            scenario_id = ""
        if not scenario_id:
            wanted = "expected a waymo.open_dataset.Scenario (of the `scenario` files, not of the `tf_example` files)"
            raise InvalidScenario(where, "scenario_id", f"{wanted}, found a record without scenario_id")
        where = identify(scenario_id)
        return _scenario(root, fields, scenario_id, where)
    except DamagedMessage as error:
        raise InvalidScenario(where, "record", f"expected a protobuf message, found {error} of the record") from None


def _scenario(root: Messages, fields: Fields, scenario_id: str, where: str) -> WireScenario:
    timestamps = doubles(fields.lists(1, "d")[1])
    if not len(timestamps):
        raise InvalidScenario(where, "timestamps_seconds", "expected one per step, found none")
    predictions = fields.parts(11).scalars("vv")
    lights = fields.parts(7).fields().parts(1)
    bits = lights.scalars("vv")
    points = lights.fields().parts(3)
    stop_point = np.full((len(lights), 3), np.nan)
    stop_point[points.owner] = doubles(points.scalars("ddd"))
    states = int32s(bits[:, 1])
    return WireScenario(
        scenario_id=scenario_id,
        timestamps=timestamps,
        current_time_index=int(int32s(root.scalars("---------v"))[0, 9]),
        sdc_track_index=int(int32s(root.scalars("-----v", missing=-1))[0, 5]),
        objects_of_interest=int32s(fields.lists(4, "v")[1]),
        tracks_to_predict=np.stack([int32s(predictions[:, 0]), enums(predictions[:, 1], 3)], axis=1),
        tracks=_tracks(fields.parts(2), len(timestamps)),
        lights=WireLights(
            step=lights.owner.astype(np.int64),
            lane=int64s(bits[:, 0]),
            state=enums(bits[:, 1], 9),
            is_state_known=(states >= 0) & (states < 9),
            stop_point=stop_point,
        ),
        map=_map(fields.parts(8)),
    )


def _tracks(tracks: Messages, num_steps: int) -> WireTracks:
    heads = tracks.scalars("vv")
    states = tracks.fields().parts(3)
    counts = np.bincount(states.owner, minlength=len(tracks))
    is_whole = counts == num_steps
    ids, types = int32s(heads[:, 0]), int32s(heads[:, 1])
    if not is_whole.all():
        states = states[np.flatnonzero(is_whole[states.owner])]
    (row,) = np.nonzero(is_whole)
    bits = states.scalars("-dddffffffv").reshape(len(row), num_steps, 11)
    rest = floats(bits[..., 4:10])
    return WireTracks(
        row=row,
        ids=ids[row],
        types=enums(heads[row, 1], 5),
        is_type_known=(types[row] >= 0) & (types[row] < 5),
        center=doubles(bits[..., 1:4]),
        size=rest[..., :3],
        heading=rest[..., 3],
        velocity=rest[..., 4:],
        valid=bits[..., 10] != 0,
        total=len(tracks),
        incomplete=list(zip(ids[~is_whole].tolist(), counts[~is_whole].tolist(), strict=True)),
    )


def _map(features: Messages) -> WaymoWireMap:
    ids = int64s(features.scalars("v")[:, 0])
    rows, kinds, bodies = _bodies(features)
    fields = bodies.fields()
    is_point = fields.number == _POINTS_FIELD[kinds][fields.owner]
    points, others = _points(fields.messages(is_point), kinds), fields.where(~is_point)
    kind = kinds[others.owner]
    lane, line, edge, sign = (others.where(kind == k) for k in (LANE, ROAD_LINE, ROAD_EDGE, STOP_SIGN))
    left, right = lane.parts(11), lane.parts(12)
    count = len(rows)
    types = [
        enums(part.column(number, "v", count), size)
        for part, number, size in ((lane, 2, 4), (line, 1, 9), (edge, 1, 3))
    ]
    return WaymoWireMap(
        ids=ids[rows],
        kinds=kinds,
        types=np.sum(types, axis=0),
        speed_limit=doubles(lane.column(1, "d", count)),
        is_interpolating=lane.column(3, "v", count) != 0,
        points=doubles(points.scalars("ddd")),
        num_points=np.bincount(points.owner, minlength=count),
        entry_lanes=_ids(lane, 9),
        exit_lanes=_ids(lane, 10),
        controlled_lanes=_ids(sign, 1),
        left_boundaries=_boundaries(lane.parts(13)),
        right_boundaries=_boundaries(lane.parts(14)),
        left_neighbors=_neighbors(left),
        right_neighbors=_neighbors(right),
        left_neighbor_boundaries=_boundaries(left.fields().parts(6)),
        right_neighbor_boundaries=_boundaries(right.fields().parts(6)),
        num_unknown=len(features) - count,
    )


def _bodies(features: Messages) -> tuple[Int64, Int64, Messages]:
    """Rows of features of known kinds, their kinds and contents; the last member of a one-of counts."""
    fields = features.fields()
    (known,) = np.nonzero(np.isin(fields.number, _KINDS) & fields.is_part)
    last = np.full(len(features), -1)
    last[fields.owner[known]] = known
    (rows,) = np.nonzero(last >= 0)
    chosen = np.zeros(len(fields.number), np.bool_)
    chosen[last[rows]] = True
    return rows, fields.number[chosen].astype(np.int64), fields.messages(chosen)


def _points(points: Messages, kinds: Int64) -> Messages:
    """Drop all positions of a stop sign except the last, which is its position."""
    superseded = (kinds[points.owner[:-1]] == STOP_SIGN) & (points.owner[:-1] == points.owner[1:])
    return points[np.flatnonzero(~np.append(superseded, False))] if superseded.any() else points


def _ids(fields: Fields, number: int) -> Int64:
    owner, ids = fields.lists(number, "v")
    return np.stack([owner, int64s(ids)], axis=1)


def _boundaries(segments: Messages) -> Int64:
    bits = segments.scalars("vvvv")
    indices, types = int32s(bits[:, :2]), enums(bits[:, 3:], 9)
    return np.concatenate([segments.owner[:, None], indices, int64s(bits[:, 2:3]), types], axis=1)


def _neighbors(neighbors: Messages) -> Int64:
    bits = neighbors.scalars("vvvvv")
    return np.concatenate([neighbors.owner[:, None], int64s(bits[:, :1]), int32s(bits[:, 1:])], axis=1)
