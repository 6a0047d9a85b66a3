"""Features of WOSAC: what is compared between a recording and its simulations.

R rollouts, N objects, E evaluated objects, T steps. Positions are in the frame of the source, because the owner's
code treats unobserved states as the origin of that frame.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from scenarionet_data.arrays.dtypes import Array, Bool, Float32, Float64, Int64
from scenarionet_data.scenario.description import ScenarioDescription
from scenarionet_data.scenario.vocabulary import LightState, MapFeatureType, is_road_edge
from scenarionet_sim.metrics.wosac import kernels

_ROUNDING = 0.7
_CYCLIC = 1.0
"""An edge whose ends are closer than this [m] is a closed line."""
_RED = (LightState.LANE_STATE_ARROW_STOP, LightState.LANE_STATE_STOP)


@dataclass(frozen=True, eq=False)
class RolloutMotion:
    """Boxes of N objects in R rollouts over T steps.

    Attributes:
        position: (R, N, T, 3) float64 [m] centres, source frame.
        heading: (R, N, T) float64 [rad].
        size: (R, N, T, 3) float32 [m] length, width, height.
        valid: (R, N, T).
    """

    position: Float64
    heading: Float64
    size: Float32
    valid: Bool


@dataclass(frozen=True, eq=False)
class Surroundings:
    """What objects move among: road edges, lanes and traffic lights, in the source frame.

    Attributes:
        edges: The road edges.
        lane_points, lane_offsets: (P, 2) and (L + 1,) centre lines of surface streets.
        light_lane: (S,) lane of each traffic light.
        light_stop: (S, 2) its stop point.
        is_red: (S, T).
    """

    edges: kernels.Edges
    lane_points: Float64
    lane_offsets: Int64
    light_lane: Int64
    light_stop: Float64
    is_red: Bool

    @classmethod
    def of(cls, scenario: ScenarioDescription) -> Surroundings:
        """Surroundings of a scenario."""
        features = scenario.map
        edges: list[Array] = []
        lanes: list[Array] = []
        lane_row: dict[str, int] = {}
        if features is not None:
            for row in np.flatnonzero(is_road_edge(features.feature_type) & (features.polyline.lengths > 1)).tolist():
                edges.append(features.polyline[row] + scenario.origin)
            is_street = features.feature_type == MapFeatureType.LANE_SURFACE_STREET
            for row in np.flatnonzero(is_street & (features.polyline.lengths > 1)).tolist():
                lane_row[features.ids[row]] = len(lanes)
                lanes.append((features.polyline[row] + scenario.origin)[:, :2])
        points, offsets = _joined(edges, 3)
        is_cyclic = np.array([((edge[0] - edge[-1]) ** 2).sum() < _CYCLIC for edge in edges], np.bool_)
        lane_points, lane_offsets = _joined(lanes, 2)
        lights = scenario.lights
        known = [row for row in range(len(lights)) if lights.lane_ids[row] in lane_row]
        return cls(
            kernels.Edges(points, offsets, is_cyclic, kernels.blocks(points, offsets)),
            lane_points,
            lane_offsets,
            np.array([lane_row[lights.lane_ids[row]] for row in known], np.int64),
            (lights.stop_point[known] + scenario.origin)[:, :2],
            np.isin(lights.state[known], _RED),
        )


class Features(NamedTuple):
    """Features of the evaluated objects, float32 or bool (R, E, T).

    Kinematics are NaN where a neighbouring step is missing. Speeds [m/s, rad/s], accelerations [m/s^2, rad/s^2],
    distances [m] (positive off the road), time to collision [s].
    """

    linear_speed: Array
    linear_acceleration: Array
    angular_speed: Array
    angular_acceleration: Array
    distance_to_nearest_object: Array
    collision: Array
    time_to_collision: Array
    distance_to_road_edge: Array
    offroad: Array
    traffic_light_violation: Array

    def since(self, step: int) -> Features:
        """The features from a step on."""
        return Features(*(values[:, :, step:] for values in self))


def compute_features(
    motion: RolloutMotion, rows: Int64, surroundings: Surroundings, dt: float, *, official: bool = True
) -> Features:
    """Compute all features of some objects.

    Args:
        motion: All objects.
        rows: (E,) the evaluated ones.
        surroundings: Map and lights.
        dt: Time step [s].
        official: Reproduce the owner's choice of the nearest lane, see :func:`kernels.nearest_lane`.
    """
    shape = (len(motion.position), len(rows), motion.position.shape[2])
    distance, time, edge = (np.empty(shape, np.float32) for _ in range(3))
    boxes = motion.position, motion.heading, motion.size
    kernels.nearest_object(*boxes, motion.valid, rows, _ROUNDING, distance)
    in_plane = np.linalg.norm(central_difference(motion.position[..., :2], axis=2), axis=-1) / dt
    kernels.time_to_object_ahead(*boxes, in_plane, motion.valid, rows, time)
    has_edges = len(surroundings.edges.boxes) > 0
    if has_edges:
        kernels.edge_distance(*boxes, rows, surroundings.edges, edge)
    edge = np.where(motion.valid[:, rows] & has_edges, edge, np.float32(-kernels.FAR))
    moves = kinematics(motion.position[:, rows], motion.heading[:, rows], dt)
    speed, acceleration, turn, turn_acceleration = (values.astype(np.float32) for values in moves)
    return Features(
        speed,
        acceleration,
        turn,
        turn_acceleration,
        distance,
        distance < 0.0,
        time,
        edge,
        edge > 0.0,
        _runs_red_light(motion.position[:, rows, :, :2], motion.valid[:, rows], surroundings, official),
    )


def kinematics(position: Float64, heading: Float64, dt: float) -> tuple[Float64, Float64, Float64, Float64]:
    """Speed, acceleration, yaw rate and yaw acceleration by central differences, (..., T) each, NaN at the ends.

    Args:
        position: (..., T, 3) [m].
        heading: (..., T) [rad].
        dt: Time step [s].
    """
    speed = np.linalg.norm(central_difference(position, axis=-2), axis=-1) / dt
    turn = _wrapped(central_difference(heading))
    return speed, central_difference(speed) / dt, turn / dt, _wrapped(central_difference(turn)) / dt**2


def central_difference(values: Float64, axis: int = -1) -> Float64:
    """Half the difference of the following and the previous value; NaN at both ends."""
    moved = np.moveaxis(values, axis, 0)
    found = np.full_like(moved, np.nan)
    found[1:-1] = 0.5 * (moved[2:] - moved[:-2])
    return np.moveaxis(found, 0, axis)


def central_validity(valid: Bool) -> Bool:
    """Whether both neighbours of a step (..., T) are valid."""
    found = np.zeros_like(valid)
    found[..., 1:-1] = valid[..., 2:] & valid[..., :-2]
    return found


def _wrapped(half: Float64) -> Float64:
    """Wrap half differences of angles so that the whole difference is in [-pi, pi)."""
    return (np.mod(2.0 * half + np.pi, 2.0 * np.pi) - np.pi) / 2.0


def _runs_red_light(xy: Float64, valid: Bool, surroundings: Surroundings, official: bool) -> Bool:
    """Steps (R, E, T) at which an object crosses the stop point of the lane it is in while its light is red."""
    runs = np.zeros(valid.shape, np.bool_)
    points, offsets = surroundings.lane_points, surroundings.lane_offsets
    nearest, segment = np.empty((2, 1), np.int64)
    for lane, stop, is_red in zip(
        surroundings.light_lane, surroundings.light_stop, surroundings.is_red[:, : valid.shape[2]], strict=True
    ):
        kernels.nearest_lane(stop[None], points, offsets, lane, lane + 1, official, nearest, segment)
        start = offsets[lane] + segment[0]
        end = points[start + 1] if start + 1 < offsets[lane + 1] else np.zeros(2)
        ahead = (xy - stop) @ (end - points[start])
        crosses = (ahead[:, :, :-1] < 0.0) & (ahead[:, :, 1:] > 0.0) & valid[:, :, 1:] & is_red[1:]
        rollout, row, step = np.nonzero(crosses)
        of_crossing, unused = np.empty((2, len(rollout)), np.int64)
        where = np.ascontiguousarray(xy[rollout, row, step + 1])
        kernels.nearest_lane(where, points, offsets, 0, len(offsets) - 1, official, of_crossing, unused)
        runs[rollout, row, step + 1] |= of_crossing == lane
    return runs


def _joined(lines: list[Array], width: int) -> tuple[Float64, Int64]:
    """Points of all lines and where each begins."""
    offsets = np.cumsum([0, *map(len, lines)])
    return np.concatenate([*lines, np.empty((0, width))]).astype(np.float64), offsets.astype(np.int64)
