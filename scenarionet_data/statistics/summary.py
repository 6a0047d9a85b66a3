"""Statistics of a scenario for filters; each is a column of ``schemas/metadata.toml``.

``summarise`` returns all of them. A stored statistic is a function here and its entry in the schema; a derived
one is an entry in the schema alone (``[derived.<name>]`` with ``sql = ...``).
"""

from __future__ import annotations

from math import cos, hypot, inf, sin, sqrt
from typing import Any

import numpy as np

from scenarionet_data.arrays.dtypes import Array
from scenarionet_data.arrays.geometry import wrap_angle
from scenarionet_data.compiled.decorators import device_function, kernel
from scenarionet_data.scenario import vocabulary
from scenarionet_data.scenario.description import MapFeatures, ScenarioDescription, Tracks
from scenarionet_data.scenario.vocabulary import ObjectType
from scenarionet_data.statistics.intersections import lanes_cross_near


def summarise(scenario: ScenarioDescription) -> dict[str, Any]:
    """Return every statistic of a valid scenario by column name, as builtins (None for null)."""
    path = ego_path(scenario)
    distance, curvature = path_distance(path), path_curvature(path)
    return {
        "ego_distance": distance,
        "ego_cumulative_curvature": curvature,
        "difficulty": distance * curvature,
        **ego_speeds(scenario),
        **object_counts(scenario.tracks),
        "num_lights": len(scenario.lights),
        "num_dropped_rows": sum(defect.count for defect in scenario.defects if defect.action == "dropped"),
        **map_counts(scenario.map),
        "map_height_diff": map_height_diff(scenario),
        "has_intersection": has_intersection(scenario, path),
        "min_ego_gap": min_ego_gap(scenario),
        **bounding_box(scenario.tracks),
    }


def ego_path(scenario: ScenarioDescription) -> Array:
    """(n, 2) float64 [m] the ego's valid positions, in order of time; gaps are left out."""
    ego = scenario.ego_index
    return scenario.tracks.position[ego, scenario.tracks.valid[ego], :2].astype(np.float64)


def path_distance(path: Array) -> float:
    """Length [m] of a path (n, 2)."""
    return float(np.hypot(*np.diff(path, axis=0).T).sum())


def path_curvature(path: Array) -> float:
    """Sum of |change of direction| [rad] along a path (n, 2), over steps longer than 0.1 m."""
    step = np.diff(path, axis=0)
    step = step[np.hypot(*step.T) > 0.1]
    return float(np.abs(wrap_angle(np.diff(np.arctan2(step[:, 1], step[:, 0])))).sum())


def ego_speeds(scenario: ScenarioDescription) -> dict[str, float]:
    """Mean and maximum speed [m/s] of the ego over its valid timesteps."""
    ego = scenario.ego_index
    speed = np.hypot(*scenario.tracks.velocity[ego, scenario.tracks.valid[ego]].astype(np.float64).T)
    return {"ego_mean_speed": float(speed.mean()), "ego_max_speed": float(speed.max())}


def travelled(tracks: Tracks) -> Array:
    """(N,) float64 [m] sum of each object's xy steps between consecutive valid timesteps, gaps bridged."""
    distance = np.zeros(len(tracks))
    _add_steps(tracks.position, tracks.valid, distance)
    return distance


@kernel
def _add_steps(position: Array, valid: Array, distance: Array) -> None:
    """Sum the steps of each row.

    Args:
        position: (N, T, 3) float32 [m].
        valid: (N, T) bool.
        distance: (N,) float64 [m], added to.
    """
    for row in range(valid.shape[0]):
        before = -1
        for step in range(valid.shape[1]):
            if not valid[row, step]:
                continue
            if before >= 0:
                x = np.float64(position[row, step, 0]) - np.float64(position[row, before, 0])
                y = np.float64(position[row, step, 1]) - np.float64(position[row, before, 1])
                distance[row] += np.hypot(x, y)
            before = step


_COUNTED = {
    "num_vehicles": ObjectType.VEHICLE,
    "num_pedestrians": ObjectType.PEDESTRIAN,
    "num_cyclists": ObjectType.CYCLIST,
    "num_cones": ObjectType.TRAFFIC_CONE,
    "num_barriers": ObjectType.TRAFFIC_BARRIER,
}


def object_counts(tracks: Tracks) -> dict[str, Any]:
    """Objects with at least one valid timestep: in all, by type, moving (more than 1 m); and counts of states."""
    present = tracks.valid.any(axis=1)
    per_type = np.bincount(tracks.object_type[present], minlength=len(ObjectType))
    counts = {name: int(per_type[kind]) for name, kind in _COUNTED.items()}
    return {
        "num_objects": int(present.sum()),
        **counts,
        "num_others": int(present.sum()) - sum(counts.values()),
        "num_moving_objects": int((travelled(tracks) > 1.0).sum()),
        "num_states": int(tracks.valid.sum()),
        "interpolated_share": float(tracks.is_interpolated.sum() / max(tracks.valid.sum(), 1)),
        "has_construction": counts["num_cones"] + counts["num_barriers"] > 0,
    }


def map_counts(features: MapFeatures | None) -> dict[str, int]:
    """Number of map features, and of lanes among them."""
    if features is None:
        return {"num_map_features": 0, "num_lanes": 0}
    return {"num_map_features": len(features), "num_lanes": int(vocabulary.is_lane(features.feature_type).sum())}


def map_height_diff(scenario: ScenarioDescription) -> float | None:
    """Highest minus lowest point [m] of road lines and edges (of lanes where there are none)."""
    features = scenario.map
    if features is None or not scenario.has_z:
        return None
    per_point = np.repeat(features.feature_type, features.polyline.lengths)
    chosen = vocabulary.is_road_line(per_point) | vocabulary.is_road_edge(per_point)
    if not chosen.any():
        chosen = vocabulary.is_lane(per_point)
    heights = features.polyline.values[chosen, 2]
    return float(np.ptp(heights)) if len(heights) else None


def has_intersection(scenario: ScenarioDescription, path: Array) -> bool:
    """Whether there are traffic lights or marked intersections; if unmarked, lanes that cross near the ego's path."""
    features = scenario.map
    if len(scenario.lights):
        return True
    if features is None:
        return False
    if (features.is_intersection >= 0).any():
        return bool((features.is_intersection == 1).any())
    return lanes_cross_near(features, path, distance=50.0, angle=np.radians(30.0))


def min_ego_gap(scenario: ScenarioDescription) -> float | None:
    """Smallest distance [m] between the ego's box and another object's; 0 where they overlap, None without another."""
    tracks = scenario.tracks
    boxes = np.empty((*tracks.valid.shape, 5))
    boxes[..., :2], boxes[..., 2], boxes[..., 3:] = tracks.position[..., :2], tracks.heading, tracks.size[..., :2]
    gap = float(nearest_box(boxes, tracks.valid, scenario.ego_index))
    return gap if np.isfinite(gap) else None


def bounding_box(tracks: Tracks) -> dict[str, float]:
    """min_x, min_y, max_x, max_y [m] of every valid position."""
    x, y = tracks.position[..., 0][tracks.valid], tracks.position[..., 1][tracks.valid]
    return {"min_x": float(x.min()), "min_y": float(y.min()), "max_x": float(x.max()), "max_y": float(y.max())}


@kernel
def nearest_box(boxes: Array, valid: Array, ego: int) -> float:
    """Smallest distance [m] between the ego's box and another's at the same timestep; 0 where they overlap.

    Args:
        boxes: (N, T, 5) x, y, heading, length, width.
        valid: (N, T) bool.
        ego: Row of the ego.

    Returns:
        Infinity when the ego is never seen together with another.
    """
    nearest = inf
    for step in range(valid.shape[1]):
        if not valid[ego, step]:
            continue
        reach = _length(boxes[ego, step, 3], boxes[ego, step, 4]) / 2
        for row in range(valid.shape[0]):
            if row == ego or not valid[row, step]:
                continue
            apart = _length(boxes[row, step, 0] - boxes[ego, step, 0], boxes[row, step, 1] - boxes[ego, step, 1])
            if apart - reach - _length(boxes[row, step, 3], boxes[row, step, 4]) / 2 < nearest:
                nearest = min(nearest, box_gap(boxes[ego, step], boxes[row, step]))
    return nearest


@device_function
def _length(x: float, y: float) -> float:
    """As ``hypot`` in a third of the time, without its protection against overflow."""
    return sqrt(x * x + y * y)


@device_function
def box_gap(first: Array, second: Array) -> float:
    """Distance between two boxes. Disjoint rectangles are nearest at a corner of one of them.

    Whether they are disjoint is the separating-axis test on their four axes.
    """
    one, one_apart = _corner_gap(first, second)
    two, two_apart = _corner_gap(second, first)
    return min(one, two) if one_apart or two_apart else 0.0


@device_function
def _corner_gap(box: Array, other: Array) -> tuple[float, bool]:
    """Distance from the nearest corner of ``other`` to ``box``, and whether an axis of ``box`` separates them."""
    c, s = cos(box[2]), sin(box[2])
    turn = other[2] - box[2]
    x, y = other[0] - box[0], other[1] - box[1]
    x, y = c * x + s * y, c * y - s * x
    c, s = cos(turn), sin(turn)
    half_length, half_width = box[3] / 2, box[4] / 2
    nearest, low_x, low_y, high_x, high_y = inf, inf, inf, -inf, -inf
    for corner in range(4):
        along = other[3] / 2 if corner < 2 else -other[3] / 2
        across = other[4] / 2 if corner % 2 else -other[4] / 2
        at_x, at_y = x + c * along - s * across, y + s * along + c * across
        nearest = min(nearest, hypot(max(abs(at_x) - half_length, 0.0), max(abs(at_y) - half_width, 0.0)))
        low_x, high_x = min(low_x, at_x), max(high_x, at_x)
        low_y, high_y = min(low_y, at_y), max(high_y, at_y)
    is_apart = low_x > half_length or high_x < -half_length or low_y > half_width or high_y < -half_width
    return nearest, is_apart
