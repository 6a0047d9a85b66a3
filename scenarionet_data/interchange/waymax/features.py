"""Features of the Waymo Open Motion Dataset's ``tf.Example``: states of objects, states of lights, the road graph.

Names, shapes and padding follow https://waymo.com/open/data/motion/tfexample and Waymax's
``dataloader/womd_utils.py``. What is missing is -1; so are the values of states that are not valid.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from scenarionet_data.arrays.dtypes import Float64, IntP
from scenarionet_data.interchange.base import Losses
from scenarionet_data.interchange.gpudrive.layout import FEATURES, HISTORY, NUM_STEPS, ROADS
from scenarionet_data.interchange.scenes import TrainingScene
from scenarionet_data.scenario.description import ScenarioDescription
from scenarionet_data.scenario.vocabulary import LightState, MapFeatureType, ObjectType

ExampleFeatures = dict[str, NDArray[Any]]

MAX_OBJECTS, MAX_LIGHTS = 128, 16

KINDS = (ObjectType.VEHICLE, ObjectType.PEDESTRIAN, ObjectType.CYCLIST, ObjectType.OTHER)
"""Types of objects, numbered as in ``ObjectType``."""

_TIMES = {"past": slice(0, HISTORY), "current": slice(HISTORY, HISTORY + 1), "future": slice(HISTORY + 1, NUM_STEPS)}
_SPACING, _WIDEST = 0.5, 0.75  # [m] between points of the road graph, as Waymo's; gaps that get points between
_MAX_EXACT = 2**24  # whole numbers up to it are exact in 32 bits
_LIGHTS = np.array([0, 0, 1, 2, 3, 4, 5, 6, 7, 8, 6, 5, 4, 0])  # Waymo's number of each LightState


def objects(scenario: ScenarioDescription, scene: TrainingScene, shift: Float64, losses: Losses) -> ExampleFeatures:
    """Return the features ``state/…``: the ego, tracks to predict, objects of interest, then those near the ego.

    Args:
        scenario: The scenario.
        scene: Its objects.
        shift: (3,) added to positions [m].
        losses: Collects what does not fit.
    """
    tracks, predicted = scenario.tracks, dict(scenario.tracks_to_predict)
    names = tracks.ids[scene.rows]
    is_predicted, is_interesting = np.isin(names, list(predicted)), np.isin(names, list(scenario.objects_of_interest))
    is_ego = np.arange(len(names)) == scene.ego
    apart = np.where(
        scene.valid[:, HISTORY], np.hypot(*(scene.position - scene.position[scene.ego])[:, HISTORY, :2].T), np.inf
    )
    order = np.lexsort((apart, ~is_interesting, ~is_predicted, ~is_ego))
    losses.leave_out("objects beyond 128", max(len(order) - MAX_OBJECTS, 0))
    kept = np.sort(order[:MAX_OBJECTS])
    ids = np.array(scene.ids, np.int64)[kept]
    losses.leave_out("ids of objects that 32 bits round", int((ids > _MAX_EXACT).sum()))
    velocity, position = scene.velocity[kept], scene.position[kept] + shift
    micros = np.rint((scenario.timestamps[scene.steps] - scenario.timestamps[scene.steps][0]) * 1e6).astype(np.int64)
    states = {
        "x": position[..., 0],
        "y": position[..., 1],
        "z": position[..., 2],
        "bbox_yaw": scene.heading[kept],
        "velocity_x": velocity[..., 0],
        "velocity_y": velocity[..., 1],
        "speed": np.hypot(velocity[..., 0], velocity[..., 1]),
        "vel_yaw": np.arctan2(velocity[..., 1], velocity[..., 0]),
        "length": scene.size[kept, :, 0],
        "width": scene.size[kept, :, 1],
        "height": scene.size[kept, :, 2],
        "timestamp_micros": np.broadcast_to(micros, scene.valid[kept].shape),
    }
    found: ExampleFeatures = {
        "state/id": _padded(ids.astype(np.float64), MAX_OBJECTS),
        "state/type": _padded(tracks.object_type[scene.rows[kept]].astype(np.float64), MAX_OBJECTS),
        "state/is_sdc": _padded(is_ego[kept].astype(np.int64), MAX_OBJECTS),
        "state/tracks_to_predict": _padded(is_predicted[kept].astype(np.int64), MAX_OBJECTS),
        "state/objects_of_interest": _padded(is_interesting[kept].astype(np.int64), MAX_OBJECTS),
        "state/difficulty_level": _padded(np.array([predicted.get(name, 0) for name in names[kept]]), MAX_OBJECTS),
    }
    for time, steps in _TIMES.items():
        valid = scene.valid[kept, steps]
        found[f"state/{time}/valid"] = _padded(valid.astype(np.int64), MAX_OBJECTS, 0)
        for name, values in states.items():
            found[f"state/{time}/{name}"] = _padded(np.where(valid, values[:, steps], -1), MAX_OBJECTS)
    return found


def lights(scenario: ScenarioDescription, scene: TrainingScene, shift: Float64, losses: Losses) -> ExampleFeatures:
    """Return the features ``traffic_light_state/…``: the lights nearest to the ego, each in one place at all times.

    Args:
        scenario: The scenario.
        scene: Its objects, and the numbers of its lanes.
        shift: (3,) added to positions [m].
        losses: Collects what does not fit.
    """
    told = scenario.lights
    known = {} if scenario.map is None else {scenario.map.ids[row]: number for row, number, _ in scene.roads}
    numbers = np.array([known.get(lane, -1) for lane in told.lane_ids], np.int64)
    state = told.state[:, scene.steps]
    stops = told.stop_point.astype(np.float64) + scenario.origin
    apart = np.hypot(*(stops - scene.position[scene.ego, HISTORY])[:, :2].T)
    is_seen = (state != LightState.ABSENT).any(axis=1)
    order = np.lexsort((apart, ~is_seen))
    losses.leave_out("traffic lights beyond 16", max(int(is_seen.sum()) - MAX_LIGHTS, 0))
    kept = np.sort(order[is_seen[order]][:MAX_LIGHTS])
    losses.leave_out("stop points of traffic lights, which are not known", int(np.isnan(stops[kept, 0]).sum()))
    losses.leave_out("lanes of traffic lights that are not in the map", int((numbers[kept] < 0).sum()))
    valid = (state[kept] != LightState.ABSENT).T  # (91, K)
    places = np.nan_to_num(stops[kept] + shift, nan=-1.0)
    micros = np.rint((scenario.timestamps[scene.steps] - scenario.timestamps[scene.steps][0]) * 1e6).astype(np.int64)
    values = {
        "state": _LIGHTS[state[kept]].T,
        "id": np.broadcast_to(numbers[kept], valid.shape),
        "x": np.broadcast_to(places[:, 0], valid.shape),
        "y": np.broadcast_to(places[:, 1], valid.shape),
        "z": np.broadcast_to(places[:, 2], valid.shape),
    }
    found: ExampleFeatures = {}
    for time, steps in _TIMES.items():
        found[f"traffic_light_state/{time}/timestamp_micros"] = micros[steps]
        found[f"traffic_light_state/{time}/valid"] = _padded(valid[steps].T.astype(np.int64), MAX_LIGHTS, 0).T
        for name, each in values.items():
            shown = np.where(valid[steps], each[steps], -1)
            found[f"traffic_light_state/{time}/{name}"] = _padded(shown.T, MAX_LIGHTS).T
    return found


def road_graph(
    scenario: ScenarioDescription, scene: TrainingScene, shift: Float64, most: int, losses: Losses
) -> ExampleFeatures:
    """Return the features ``roadgraph_samples/…``: points of lanes, lines, edges and areas, half a metre apart.

    Points farthest from the ego's path are left out first. A point's direction is that to the next point of the
    feature; the last has that of the point before, and a point alone has none.

    Args:
        scenario: The scenario.
        scene: Its roads.
        shift: (3,) added to positions [m].
        most: Number of points.
        losses: Collects what does not fit.
    """
    features = scenario.map
    kinds, outlines = [], []
    for row, _, points in scene.roads:
        kind = MapFeatureType(features.feature_type[row]) if features is not None else MapFeatureType.UNKNOWN
        kinds.append(ROADS[kind][1])
        is_area = features is not None and not len(features.polyline[row])
        outlines.append(np.concatenate([points, points[:1]]) if is_area else points)
        losses.leave_out("types of map features that Waymax does not distinguish", int(FEATURES[kinds[-1]] != kind))
    xyz, direction, owner = sample_lines(outlines)
    if len(xyz) > most:
        path = scene.position[scene.ego][scene.valid[scene.ego]][::10, :2]
        apart = np.min([np.hypot(*(xyz[:, :2] - point).T) for point in path], axis=0)
        kept = np.sort(np.argsort(apart, kind="stable")[:most])
        losses.leave_out("points of the map, far from the ego", len(xyz) - most)
        xyz, direction, owner = xyz[kept], direction[kept], owner[kept]
    numbers = np.array([number for _, number, _ in scene.roads], np.int64)
    return {
        "roadgraph_samples/xyz": _padded(xyz + shift, most),
        "roadgraph_samples/dir": _padded(direction, most),
        "roadgraph_samples/id": _padded(numbers[owner][:, None], most),
        "roadgraph_samples/type": _padded(np.array(kinds, np.int64)[owner][:, None], most),
        "roadgraph_samples/valid": _padded(np.ones((len(owner), 1), np.int64), most, 0),
    }


def sample_lines(lines: list[Float64]) -> tuple[Float64, Float64, IntP]:
    """Return the points of lines with others between them, so that no two are farther apart than 0.75 m.

    Args:
        lines: (P, 3) points of each [m]; P is at least 1.

    Returns:
        Points (Q, 3), their directions (Q, 3) and the number of the line (Q,) of each.
    """
    counts = np.array([len(line) for line in lines], np.intp)
    points, owner = np.concatenate([np.zeros((0, 3)), *lines]), np.repeat(np.arange(len(lines)), counts)
    ahead = np.diff(points, axis=0, append=points[-1:])
    is_last = np.ones(len(points), np.bool_)
    is_last[:-1] = owner[1:] != owner[:-1]
    ahead[is_last] = 0.0
    gaps = np.linalg.norm(ahead, axis=1)
    times = np.where(gaps > _WIDEST, np.ceil(gaps / _SPACING), 1).astype(np.intp)
    source = np.repeat(np.arange(len(points)), times)
    part = (np.arange(len(source)) - np.repeat(np.cumsum(times) - times, times)) / times[source]
    direction = ahead / np.maximum(gaps, 1e-9)[:, None]
    before = np.maximum(np.arange(len(points)) - 1, 0)
    has_before = is_last & (owner[before] == owner)
    direction[has_before] = direction[before[has_before]]
    return points[source] + part[:, None] * ahead[source], direction[source], owner[source]


def _padded(values: NDArray[Any], count: int, missing: float = -1) -> NDArray[Any]:
    """Return ``values`` with ``missing`` rows after them, ``count`` in all."""
    padded = np.full((count, *values.shape[1:]), missing, values.dtype)
    padded[: len(values)] = values
    return padded
