"""Convert map features and traffic lights to ScenarioNet's format.

Features that MetaDrive cannot read are dropped and listed in the metadata: a lane, line or edge without points, a
crosswalk, sidewalk or stop sign without geometry (``omitted_map_features``), and a lane's polygon whose centre is
100 m or more from that of its centreline (``omitted_polygons``).
"""

from __future__ import annotations

from typing import Any

import numpy as np

from scenarionet_data.arrays.dtypes import Bool, Float32, UInt8
from scenarionet_data.arrays.ragged import Ragged
from scenarionet_data.converters.boundary_segments import to_records
from scenarionet_data.scenario.canonical_json import from_json
from scenarionet_data.scenario.description import MapFeatures, ScenarioDescription
from scenarionet_data.scenario.vocabulary import (
    LIGHT_COLORS,
    LightState,
    MapFeatureType,
    Provenance,
    is_lane,
    is_road_edge,
    is_road_line,
    names,
)

_FEATURE_TYPES = names(MapFeatureType)
_LIGHT_STATES = names(LightState)
_LIGHT_STATES[LightState.ABSENT] = None
_AREAS = (MapFeatureType.CROSSWALK, MapFeatureType.ROAD_EDGE_SIDEWALK)
_KMH, _MPH = 3.6, 3.6 / 1.609344
_MAX_CENTROID_DISTANCE = 100.0


def is_flat(scenario: ScenarioDescription) -> bool:
    """Whether the map has no heights: every z is 0 in the source frame."""
    if scenario.map is None:
        return True
    origin_z = scenario.origin[2]
    return not any((ragged.values[:, 2] + origin_z).any() for ragged in (scenario.map.polyline, scenario.map.polygon))


def describe_map(features: MapFeatures | None, *, flat: bool) -> tuple[dict[str, Any], dict[str, Any]]:
    """Return map features by id.

    Args:
        features: None for a scenario without a map.
        flat: Write 2D points, as in ScenarioNet's maps of datasets without heights.

    Returns:
        The features, and metadata that lists dropped features (empty if there are none).
    """
    if features is None:
        return {}, {}
    types_by_id = dict(zip(features.ids, _FEATURE_TYPES[features.feature_type], strict=True))
    readable, lanes = _is_readable(features), is_lane(features.feature_type)
    polylines, polygons = _points(features.polyline, flat), _points(features.polygon, flat)
    described: dict[str, Any] = {}
    omitted: dict[str, list[str]] = {"omitted_map_features": [], "omitted_polygons": []}
    for row, feature_id in enumerate(features.ids):
        polyline, polygon = polylines[row], polygons[row]
        if not readable[row]:
            omitted["omitted_map_features"].append(str(feature_id))
            continue
        if len(polyline) and len(polygon) and _centroid_distance(polyline, polygon) >= _MAX_CENTROID_DISTANCE:
            omitted["omitted_polygons"].append(str(feature_id))
            polygon = polygon[:0]
        feature = _describe_feature(features, row, polyline, polygon)
        if lanes[row]:
            feature |= _describe_lane(features, row, feature, types_by_id)
        described[str(feature_id)] = feature
    return described, {name: ids for name, ids in omitted.items() if ids}


def _points(ragged: Ragged, flat: bool) -> Ragged:
    """Return a writable, contiguous copy of 2D or 3D points."""
    return Ragged(ragged.offsets, np.array(ragged.values[:, : 2 if flat else 3], order="C"))


def _is_readable(features: MapFeatures) -> Bool:
    """(M,) whether a feature has the geometry that MetaDrive requires: a centreline, a line or an area."""
    types, line, area = features.feature_type, features.polyline.lengths, features.polygon.lengths
    needs_area = np.isin(types, _AREAS)
    is_edge = is_road_edge(types) & (types != MapFeatureType.GUARDRAIL)  # which MetaDrive ignores
    needs_line = is_lane(types) | is_road_line(types) | is_edge | (types == MapFeatureType.STOP_SIGN)
    return np.where(needs_area, area >= 3, (line > 0) | ~needs_line)


def _centroid_distance(polyline: Float32, polygon: Float32) -> float:
    between = polyline[:, :2].mean(axis=0, dtype=np.float64) - polygon[:, :2].mean(axis=0, dtype=np.float64)
    return float(np.hypot(*between))


def _describe_feature(features: MapFeatures, row: int, polyline: Float32, polygon: Float32) -> dict[str, Any]:
    feature: dict[str, Any] = {"type": str(_FEATURE_TYPES[features.feature_type[row]])}
    if features.feature_type[row] == MapFeatureType.STOP_SIGN:
        feature["position"] = polyline[0]
    elif len(polyline):
        feature["polyline"] = polyline
    if len(polygon):
        feature["polygon"] = polygon
    if len(features.controlled_lanes[row]):
        feature["lane"] = _ids(features.controlled_lanes, row)
    if features.is_intersection[row] >= 0:
        feature["is_intersection"] = bool(features.is_intersection[row])
    if features.extras[row]:
        feature["extras"] = to_records(from_json(features.extras[row]))
    return feature


def _describe_lane(
    features: MapFeatures, row: int, feature: dict[str, Any], types_by_id: dict[str, str]
) -> dict[str, Any]:
    """Fields of lanes."""
    num_points, extras = len(feature["polyline"]), feature.get("extras", {})
    lane: dict[str, Any] = {
        "entry_lanes": _ids(features.entry_lanes, row),
        "exit_lanes": _ids(features.exit_lanes, row),
        "left_neighbor": _ids(features.left_neighbors, row),
        "right_neighbor": _ids(features.right_neighbors, row),
    }
    for name in ("left_boundaries", "right_boundaries"):
        ids = _ids(getattr(features, name), row)
        lane[name] = extras.get(name) or [_whole_boundary(i, num_points, types_by_id) for i in ids]
    if "interpolating" in extras:
        lane["interpolating"] = bool(extras["interpolating"])
    if np.isfinite(features.speed_limit[row]):
        lane["speed_limit_kmh"] = float(features.speed_limit[row]) * _KMH
        lane["speed_limit_mph"] = float(features.speed_limit[row]) * _MPH
    if len(features.width[row]):
        lane["width"] = np.array(np.broadcast_to(features.width[row], (num_points, 2)))
        lane["is_width_constant"] = len(features.width[row]) == 1
    if feature.get("polygon", np.zeros((0, 2))).shape[1] == 3:
        # MetaDrive fails on 3D lane polygons: heights are stored separately.
        lane["polygon"] = np.array(feature["polygon"][:, :2], order="C")
        lane["polygon_z"] = np.array(feature["polygon"][:, 2])
    return lane


def _whole_boundary(feature_id: str, num_points: int, types_by_id: dict[str, str]) -> dict[str, str]:
    """ScenarioNet's boundary record, with str values, for a line or edge along the whole lane."""
    return {
        "lane_start_index": "0",
        "lane_end_index": str(max(num_points - 1, 0)),
        "boundary_type": str(types_by_id.get(feature_id, "UNKNOWN")),
        "boundary_feature_id": feature_id,
    }


def _ids(ragged: Ragged, row: int) -> list[str]:
    return [str(identifier) for identifier in ragged[row]]


def describe_lights(scenario: ScenarioDescription, dataset: str) -> dict[str, Any]:
    """Return traffic lights by the id of the lane they control, as MetaDrive expects them.

    Several lights of one lane are merged to the most restrictive state at each timestep (red before yellow, green,
    unknown); ``metadata["light_ids"]`` lists them. A light without a stop point is placed at the start of its lane
    (``is_stop_point_assumed``), or at the scenario's origin if the map lacks the lane.
    """
    lights = scenario.lights
    rows_of_lane: dict[str, list[int]] = {}
    for row, lane_id in enumerate(lights.lane_ids):
        rows_of_lane.setdefault(str(lane_id), []).append(row)
    described = {}
    for lane_id, rows in rows_of_lane.items():
        recorded = [row for row in rows if np.isfinite(lights.stop_point[row, :2]).all()]
        inferred = bool((lights.provenance[rows] == Provenance.INFERRED).any())
        metadata: dict[str, Any] = {
            "track_length": scenario.num_timesteps,
            "type": "TRAFFIC_LIGHT",
            "object_id": lane_id,
            "dataset": dataset,
            "light_ids": [str(light_id) for light_id in lights.ids[rows]],
            "provenance": (Provenance.INFERRED if inferred else Provenance.OBSERVED).name,
            "is_stop_point_assumed": not recorded,
        }
        stop = lights.stop_point[recorded[0]] if recorded else _lane_start(scenario.map, lane_id)
        described[lane_id] = {
            "type": "TRAFFIC_LIGHT",
            "state": {"object_state": _LIGHT_STATES[_most_restrictive(lights.state[rows])].tolist()},
            "stop_point": np.nan_to_num(stop),
            "lane": lane_id,
            "metadata": metadata,
        }
    return described


def _most_restrictive(states: UInt8) -> UInt8:
    """Merge (lights, T) codes to (T,); LightColor's codes increase from unknown to red."""
    rank = np.where(states == LightState.ABSENT, 0, LIGHT_COLORS[states] + 1)
    chosen: UInt8 = states[rank.argmax(axis=0), np.arange(states.shape[1])]
    return chosen


def _lane_start(features: MapFeatures | None, lane_id: str) -> Float32:
    if features is not None:
        for row in np.flatnonzero(features.ids == lane_id):
            if len(points := features.polyline[int(row)]):
                return np.array(points[0])
    return np.zeros(3, np.float32)
