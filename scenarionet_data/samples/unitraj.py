"""The layout of UniTraj's ``BaseDataset``, which its MTR, Wayformer and AutoBot read.

Source: https://github.com/vita-epfl/UniTraj, ``unitraj/datasets/base_dataset.py`` (2025), with
``manually_split_lane: False``. :func:`unitraj` lists where this differs.
"""

from __future__ import annotations

import numpy as np

from scenarionet_data.arrays.dtypes import Array, Bool, Float32, Float64, Int64
from scenarionet_data.arrays.geometry import rotate
from scenarionet_data.building.resampling import resample
from scenarionet_data.samples.choices import Choices
from scenarionet_data.samples.scenes import Scenes
from scenarionet_data.scenario.description import MapFeatures, ScenarioDescription
from scenarionet_data.scenario.vocabulary import MapFeatureType, ObjectType

_RANGE = 100.0
"""Half the side of the square of the map around its centre [m]: ``map_range``."""
_AHEAD = np.array([30.0, 0.0])
"""Centre of that square, in the target's frame [m]: ``center_offset_of_map``."""
_STEP = 0.5
"""Distance between points of lines that are interpolated [m]."""
_ACCELERATION_DT = 0.1
"""Timestep of accelerations [s], whatever that of the data."""
_FAR = 1e10
_NUM_TYPES = 20

_T = MapFeatureType
_LANES = {_T.LANE_FREEWAY: 1, _T.LANE_SURFACE_STREET: 2, _T.LANE_SURFACE_UNSTRUCTURE: 2, _T.LANE_BIKE_LANE: 3}
_LINES = {
    _T.ROAD_LINE_BROKEN_SINGLE_WHITE: 6,
    _T.ROAD_LINE_SOLID_SINGLE_WHITE: 7,
    _T.ROAD_EDGE_SIDEWALK: 7,
    _T.ROAD_LINE_SOLID_DOUBLE_WHITE: 8,
    _T.ROAD_LINE_BROKEN_SINGLE_YELLOW: 9,
    _T.ROAD_LINE_BROKEN_DOUBLE_YELLOW: 10,
    _T.ROAD_LINE_SOLID_SINGLE_YELLOW: 11,
    _T.ROAD_LINE_SOLID_DOUBLE_YELLOW: 12,
    _T.ROAD_LINE_PASSING_DOUBLE_YELLOW: 13,
    _T.ROAD_EDGE_BOUNDARY: 15,
    _T.ROAD_EDGE_MEDIAN: 16,
}
_SIGNS = {_T.STOP_SIGN: 17}
_AREAS = {_T.CROSSWALK: 18, _T.SPEED_BUMP: 19}
_X, _Y, _LENGTH, _HEADING, _VELOCITY, _VALID = 0, 1, 3, 6, slice(7, 9), 9
"""Columns of a state: x, y, z, length, width, height, heading, velocity, validity."""


def unitraj(scenes: Scenes, choices: Choices) -> dict[str, Array]:
    """Arrays under UniTraj's names, of B samples with A agents, H timesteps of history and F of future.

    It reads ``window``, ``targets``, ``agents.count`` (``max_num_agents``), ``polylines.count`` (``max_num_roads``)
    and ``polylines.points`` (``max_points_per_lane``), and expects ``perspective="agent"``.

    Differences from UniTraj: velocities of unobserved timesteps are 0, which shows in the acceleration after a gap;
    of agents at the same distance (those not seen now) the first ones are taken; scenarios that are too short give no
    sample, instead of zeros before their beginning; ``masked_attributes``, ``kalman_difficulty`` and
    ``trajectory_type`` are left to the training code.

    Returns:
        * ``obj_trajs`` (B, A, H, 18 + H) float32: x, y, z, length, width, height; one-hot vehicle, pedestrian, cyclist,
          target, ego; one-hot timestep, time [s]; sine and cosine of the heading; velocity; acceleration;
        * ``obj_trajs_mask`` (B, A, H) bool, ``obj_trajs_pos`` (B, A, H, 3), ``obj_trajs_last_pos`` (B, A, 3);
        * ``obj_trajs_future_state`` (B, A, F, 4) x, y, velocity, ``obj_trajs_future_mask`` (B, A, F) bool;
        * ``center_gt_trajs`` (B, F, 4), ``center_gt_trajs_mask`` (B, F), ``center_gt_final_valid_idx`` (B,);
        * ``center_objects_world`` (B, 10), ``center_objects_type`` (B,) int64, ``center_gt_trajs_src`` (B, H + F, 10):
          states in the scenario's frame; ``track_index_to_predict`` (B,) int64: 0;
        * ``map_polylines`` (B, L, N, 29) float32: position, direction, position of the point before, one-hot type;
          ``map_polylines_mask`` (B, L, N) bool, ``map_polylines_center`` (B, L, 3).
    """
    requests = scenes.requests
    regular = [_regular(scenario, choices.window.dt) for scenario in scenes.descriptions]
    points = [_points(scenario.map, choices.polylines.points) for scenario in regular]
    found = []
    for scene, moment, targets in zip(requests.scene, requests.moment, requests.targets, strict=True):
        time = scenes.descriptions[scene].timestamps[moment]
        now = int(np.argmin(np.abs(regular[scene].timestamps - time)))
        found.append(_sample(regular[scene], points[scene], now, targets[0], choices))
    return {name: np.stack([sample[name] for sample in found]) for name in found[0]}


def _regular(scenario: ScenarioDescription, dt: float) -> ScenarioDescription:
    """A scenario on timesteps of ``dt``; recorded times within one timestep of these are ignored, as there."""
    drift = np.abs(scenario.timestamps - np.arange(scenario.num_timesteps) * dt).max()
    return scenario if abs(scenario.dt - dt) <= 0.05 * dt and drift <= dt else resample(scenario, dt)


def _sample(
    scenario: ScenarioDescription, points: tuple[Float64, Int64], now: int, target_id: str, choices: Choices
) -> dict[str, Array]:
    window = choices.window
    times = slice(now + 1 - window.num_history, now + 1 + window.num_future)
    target = scenario.tracks.index(target_id)
    states = _states(scenario, times)
    centre = states[target, window.num_history - 1]
    own = _centred(states, centre)
    history, future = own[:, : window.num_history], own[:, window.num_history :]
    seen: Bool = history[..., _VALID] > 0
    kept = np.flatnonzero(seen.any(axis=1))
    features = _features(scenario, history, target, scenario.timestamps[times][: window.num_history])
    features[~seen] = 0
    distance = np.where(seen[kept, -1], np.linalg.norm(features[kept, -1, :2], axis=-1), _FAR)
    order = kept[np.argsort(distance, kind="stable")][: choices.agents.count]
    moving = future[..., [_X, _Y, 7, 8]].astype(np.float32)
    moving[future[..., _VALID] == 0] = 0
    valid: Bool = future[target, :, _VALID] > 0
    lines = _map(points, centre, choices)
    return {
        "obj_trajs": _padded(features[order], choices.agents.count),
        "obj_trajs_mask": _padded(seen[order], choices.agents.count),
        "obj_trajs_pos": _padded(features[order, :, :3], choices.agents.count),
        "obj_trajs_last_pos": _padded(_last(features[order, :, :3], seen[order]), choices.agents.count),
        "obj_trajs_future_state": _padded(moving[order], choices.agents.count),
        "obj_trajs_future_mask": _padded(future[order, :, _VALID] > 0, choices.agents.count),
        "track_index_to_predict": np.array(0),
        "center_gt_trajs": moving[target],
        "center_gt_trajs_mask": valid.astype(np.float32),
        "center_gt_final_valid_idx": np.float32(np.flatnonzero(valid)[-1] if valid.any() else 0),
        "center_objects_world": centre.astype(np.float32),
        "center_objects_type": np.array(_kinds(scenario)[target], np.int64),
        "center_gt_trajs_src": states[target].astype(np.float32),
        "map_polylines": lines[0],
        "map_polylines_mask": lines[1],
        "map_polylines_center": lines[2],
    }


def _states(scenario: ScenarioDescription, times: slice) -> Float64:
    """(N, K, 10) states of the window, in the scenario's frame."""
    tracks = scenario.tracks
    parts = (tracks.position, tracks.size, tracks.heading[..., None], tracks.velocity, tracks.valid[..., None])
    return np.concatenate([part[:, times] for part in parts], axis=-1, dtype=np.float64)


def _centred(states: Float64, centre: Float64) -> Float64:
    """States in the frame of the target's."""
    moved = states.copy()
    moved[..., :3] -= centre[:3]
    moved[..., :2] = rotate(moved[..., :2], -centre[_HEADING])
    moved[..., _HEADING] -= centre[_HEADING]
    moved[..., _VELOCITY] = rotate(moved[..., _VELOCITY], -centre[_HEADING])
    return moved


def _kinds(scenario: ScenarioDescription) -> Int64:
    kinds = scenario.tracks.object_type.astype(np.int64)
    return np.where(kinds <= ObjectType.OTHER, kinds, 0)


def _features(scenario: ScenarioDescription, history: Float64, target: int, times: Float64) -> Float32:
    """(N, H, 18 + H) inputs of the agents."""
    count, steps = history.shape[:2]
    classes = np.zeros((count, steps, 5))
    kinds = _kinds(scenario)
    for column, kind in enumerate((ObjectType.VEHICLE, ObjectType.PEDESTRIAN, ObjectType.CYCLIST)):
        classes[kinds == kind, :, column] = 1
    classes[target, :, 3] = 1
    classes[scenario.ego_index, :, 4] = 1
    clock = np.broadcast_to(np.column_stack([np.eye(steps), times]), (count, steps, steps + 1))
    heading = history[..., _HEADING, None]
    velocity = history[..., _VELOCITY]
    acceleration = (velocity - np.roll(velocity, 1, axis=1)) / _ACCELERATION_DT
    if steps > 1:
        acceleration[:, 0] = acceleration[:, 1]
    parts = [history[..., :_HEADING], classes, clock, np.sin(heading), np.cos(heading), velocity, acceleration]
    return np.concatenate(parts, axis=-1, dtype=np.float32)


def _last(positions: Float32, seen: Bool) -> Float32:
    """Last position of each agent that is seen."""
    steps = positions.shape[1]
    last = steps - 1 - np.argmax(seen[:, ::-1], axis=1)
    found: Float32 = positions[np.arange(len(positions)), last]
    found[~seen.any(axis=1)] = 0
    return found


def _padded(values: Array, count: int) -> Array:
    """Values with zeros behind, up to a number of rows."""
    return np.pad(values, [(0, count - len(values)), *[(0, 0)] * (values.ndim - 1)])


def _points(features: MapFeatures | None, longest: int) -> tuple[Float64, Int64]:
    """Points (P, 7) of all lines, lanes first, areas last: position, direction from the point before, type.

    Returns:
        The points, and the number of each one's line (P,).
    """
    if features is None:
        return np.zeros((0, 7)), np.zeros(0, np.int64)
    groups: tuple[list[Float64], ...] = ([], [], [], [])
    for row, kind in enumerate(features.feature_type.tolist()):
        line, outline = features.polyline[row].astype(np.float64), features.polygon[row].astype(np.float64)
        if kind in _LANES:
            groups[0].append(_directed(_spaced(line) if len(line) < longest else line, _LANES[kind]))
        elif kind in _LINES:
            groups[1].append(_directed(_spaced(line if len(line) else outline), _LINES[kind]))
        elif kind in _SIGNS:
            groups[2].append(_directed(line[:1], _SIGNS[kind]))
        elif kind in _AREAS:
            groups[3].append(_directed(outline, _AREAS[kind]))
    lines = [line for group in groups for line in group]
    points = np.concatenate([np.zeros((0, 7)), *lines])
    return points, np.repeat(np.arange(len(lines)), [len(line) for line in lines])


def _spaced(line: Float64) -> Float64:
    """Points at equal distances along a line, without height; a single point stays."""
    if len(line) < 2:
        return line
    arcs = np.append(0.0, np.cumsum(np.hypot(*np.diff(line[:, :2], axis=0).T)))
    at = np.arange(0.0, arcs[-1], _STEP)
    return np.column_stack([np.interp(at, arcs, line[:, 0]), np.interp(at, arcs, line[:, 1]), np.zeros(len(at))])


def _directed(line: Float64, kind: int) -> Float64:
    step = np.diff(line, axis=0, prepend=line[:1])
    direction = step / np.maximum(np.linalg.norm(step, axis=-1, keepdims=True), 1e-6)
    directed: Float64 = (
        np.column_stack([line, direction, np.full(len(line), kind)]).astype(np.float32).astype(np.float64)
    )
    return directed


def _map(lines_of: tuple[Float64, Int64], centre: Float64, choices: Choices) -> tuple[Float32, Bool, Float32]:
    """Polylines nearest to the centre of the map, their mask, and the mean of their points."""
    count, longest = choices.polylines.count, choices.polylines.points
    own, line = lines_of[0].copy(), lines_of[1]
    own[:, :3] -= centre[:3]
    for columns in (slice(0, 2), slice(3, 5)):
        own[:, columns] = rotate(own[:, columns], -centre[_HEADING])
    rows, mask = _pieces(own, line, longest)
    lines = own[rows]
    lines[~mask] = 0
    # As there: points beyond the end of a piece count with the distance of the origin.
    distance = np.linalg.norm(lines[..., :2] - _AHEAD, axis=-1).sum(axis=-1) / np.maximum(mask.sum(axis=-1), 1)
    order = np.argsort(distance)[:count]
    lines, mask = lines[order], mask[order]
    before = np.roll(lines[..., :3], 1, axis=1)
    before[:, 0] = before[:, 1]
    kinds = np.eye(_NUM_TYPES)[lines[..., -1].astype(int)]
    made = np.concatenate([lines[..., :-1], before, kinds], axis=-1)
    made[~mask] = 0
    middle = lines[..., :3].sum(axis=1) / np.maximum(mask.sum(axis=-1, keepdims=True), 1)
    return _padded(made.astype(np.float32), count), _padded(mask, count), _padded(middle.astype(np.float32), count)


def _pieces(own: Float64, line: Int64, longest: int) -> tuple[Int64, Bool]:
    """Parts of lines within the map's square, thinned to a number of points.

    Args:
        own: (P, 7) points in the target's frame.
        line: (P,) number of each point's line.
        longest: N points of a part.

    Returns:
        (M, N) rows of the points of each part, and (M, N) whether there is a point.
    """
    is_inside = (np.abs(own[:, :2] - _AHEAD) < _RANGE).all(axis=1)
    is_first = np.append(True, (np.diff(line) != 0) | (np.diff(is_inside) != 0))[: len(line)]
    starts = np.flatnonzero(is_first)
    lengths = np.diff(np.append(starts, len(line)))
    starts, lengths = starts[is_inside[starts]], lengths[is_inside[starts]]
    places, is_long = np.arange(longest), (lengths > longest)[:, None]
    thinned = (places * ((lengths - 1) / (longest - 1))[:, None]).astype(np.int64)
    thinned[:, -1] = lengths - 1
    offsets = np.where(is_long, thinned, places)
    mask: Bool = offsets < lengths[:, None]
    return starts[:, None] + np.where(mask, offsets, 0), mask
