"""Map features and traffic lights out of ScenarioNet pickles of every vintage."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from scenarionet_data.building import MapBuilder
from scenarionet_data.converters.scenarionet.frame import Frame
from scenarionet_data.converters.stretches import to_rows
from scenarionet_data.errors import InvalidScenario
from scenarionet_data.scenario import Float64, Lights, MapFeatures, strings
from scenarionet_data.vocabulary import LightState, MapFeatureType, Provenance

# Limits that ScenarioNet and MetaDrive write where the source has none [km/h].
_INVENTED_LIMITS = {"nuscenes": (100.0,), "av2": (85.0 * 1.609344,), "metadrive": (1000.0, 100.0)}
_LIGHT_STATES: dict[str | None, int] = {None: LightState.ABSENT, **{s.name: s for s in LightState if s}}
_FEATURE_TYPES = dict(MapFeatureType.__members__)
# Their lists of ids, and ours; neighbours and boundaries are records in Waymo's pickles.
_ID_LISTS = {
    "entry_lanes": "entry_lanes",
    "exit_lanes": "exit_lanes",
    "left_neighbor": "left_neighbors",
    "right_neighbor": "right_neighbors",
    "left_boundaries": "left_boundaries",
    "right_boundaries": "right_boundaries",
    "lane": "controlled_lanes",
}
_LISTS = (list, tuple, np.ndarray)
_ID_KEYS = ("feature_id", "boundary_feature_id", "id")

Features = Mapping[Any, Mapping[str, Any]]


def make_map(features: Features, frame: Frame) -> tuple[MapFeatures | None, dict[str, int]]:
    """Map features in canonical form.

    Args:
        features: ``description["map_features"]``.
        frame: Theirs.

    Returns:
        The map, None when there is none; and the types that this project does not know, with how often they
        were dropped.
    """
    builder = MapBuilder()
    unknown: Counter[str] = Counter()
    # nuScenes' lanes are (x, y, heading); its map has no heights.
    quirks, ground = frame.quirks, frame.ground
    is_flat = quirks == "nuscenes"
    for feature_id, feature in features.items():
        word = str(feature["type"])
        if word not in _FEATURE_TYPES:
            unknown[word] += 1
            continue
        links = {key: _listed(feature[key]) for key in _ID_LISTS if key in feature}
        builder.add(
            str(feature_id),
            _FEATURE_TYPES[word],
            polyline=_line(feature, frame, ground, is_flat),
            polygon=_polygon(feature, ground, is_flat) if "polygon" in feature else None,
            speed_limit=_speed_limit(feature, quirks) if word.startswith("LANE_") else np.nan,
            width=_width(feature),
            is_intersection=feature.get("is_intersection"),
            extras=to_rows(feature.get("extras") or {} if frame.is_ours else _details(feature, links)),
            **{_ID_LISTS[key]: _ids(items) for key, items in links.items() if items},
        )
    return (builder.build(frame.local_origin, frame.has_z) if len(builder) else None), dict(sorted(unknown.items()))


def _line(feature: Mapping[str, Any], frame: Frame, ground: float, is_flat: bool) -> Float64 | None:
    """(n, 3) polyline, or the one point of a stop sign."""
    if "position" not in feature:
        return _points(feature.get("polyline"), ground, is_flat)
    position = _points(feature["position"], ground, is_flat)
    return None if position is None else position + frame.moved


def _polygon(feature: Mapping[str, Any], ground: float, is_flat: bool) -> Float64 | None:
    """(n, 3) outline; our own export keeps a lane's heights beside it."""
    points = _points(feature["polygon"], ground, is_flat)
    if points is not None and "polygon_z" in feature:
        points[:, 2] = feature["polygon_z"]
    return points


def _points(points: Any, ground: float, is_flat: bool) -> Float64 | None:
    """(n, 3) from (n, 2) or (n, 3) lists or arrays, or from a single point."""
    if points is None or not len(points):
        return None
    array = np.asarray(points, dtype=np.float64)
    array = array[None] if array.ndim == 1 else array
    if array.shape[1] == 3 and not is_flat:
        return array
    spatial = np.empty((len(array), 3))
    spatial[:, :2], spatial[:, 2] = array[:, :2], ground
    return spatial


def _width(feature: Mapping[str, Any]) -> Any:
    """Width as it is; None where it is all 0 as in Argoverse 2 pickles, for no lane is that wide."""
    if "width" not in feature:
        return None
    width = np.asarray(feature["width"])
    return width if width.any() else None


def _listed(items: Any) -> Sequence[Any]:
    """A list of ids (int or str) or of Waymo's records, or a single id, as a list."""
    if type(items) is list:
        return items
    return () if items is None else list(items) if isinstance(items, _LISTS) else [items]


def _ids(items: Sequence[Any]) -> list[str]:
    return [str(_id(item) if isinstance(item, dict) else item) for item in items]


def _id(record: Mapping[str, Any]) -> Any:
    for key in _ID_KEYS:
        if key in record:
            return record[key]
    raise KeyError(_ID_KEYS[0])


def _details(feature: Mapping[str, Any], links: Mapping[str, Sequence[Any]]) -> dict[str, Any]:
    """What Waymo's records say of neighbours and boundaries beyond ids: from which point to which."""
    # The items of a list are of one kind.
    details: dict[str, Any] = {key: items for key, items in links.items() if items and isinstance(items[0], dict)}
    return details | {"interpolating": True} if feature.get("interpolating") is True else details


def _speed_limit(feature: Mapping[str, Any], dataset: str) -> float:
    """Limit [m/s]; NaN when the source has none."""
    if feature.get("speed_limit_mps"):
        return float(feature["speed_limit_mps"])
    kmh = feature.get("speed_limit_kmh")
    if kmh is None and feature.get("speed_limit_mph"):
        kmh = feature["speed_limit_mph"] * 1.609344
    if not kmh or any(abs(kmh - invented) < 1e-3 for invented in _INVENTED_LIMITS.get(dataset, ())):
        return np.nan
    return float(kmh) / 3.6


def make_lights(description: Mapping[str, Any], frame: Frame, where: str) -> Lights:
    """Traffic lights in canonical form.

    Args:
        description: The pickle; its lights have the ids of their lanes.
        frame: Its frame.
        where: Names the pickle in errors.

    Raises:
        InvalidScenario: A light has not T states, or states that ScenarioNet does not know.
    """
    length, states = description["length"], description["dynamic_map_states"]
    if not states:
        return Lights.empty(length)
    lanes = [str(lane_id) for lane_id in states]
    in_map = {str(feature_id) for feature_id in description["map_features"]}
    metadata = [light.get("metadata", {}) for light in states.values()]
    ids = [described.get("light_ids", []) for described in metadata]
    codes = [_codes(light, lane, length, where) for lane, light in zip(lanes, states.values(), strict=True)]
    points = np.array([_stop_point(light, frame.ground) for light in states.values()], dtype=np.float64)
    provenance = [Provenance[described.get("provenance", "OBSERVED")] for described in metadata]
    return Lights(
        ids=strings(own[0] if len(own) == 1 else lane for own, lane in zip(ids, lanes, strict=True)),
        lane_ids=strings(lanes),
        stop_point=(points - frame.local_origin).astype(np.float32),
        state=np.array(codes, dtype=np.uint8),
        is_lane_in_map=np.array([lane in in_map for lane in lanes], dtype=np.bool_),
        provenance=np.array(provenance, dtype=np.uint8),
    )


def _codes(light: Mapping[str, Any], lane: str, length: int, where: str) -> list[int]:
    words = list(light["state"]["object_state"])
    path = f"dynamic_map_states[{lane!r}].state.object_state"
    if len(words) != length:
        raise InvalidScenario(where, path, f"wanted {length} states, found {len(words)}")
    unknown = set(words) - set(_LIGHT_STATES)
    if unknown:
        raise InvalidScenario(where, path, f"wanted names of LightState or None, found {sorted(unknown)[0]!r}")
    return [_LIGHT_STATES[word] for word in words]


def _stop_point(light: Mapping[str, Any], ground: float) -> Float64:
    """(3,) where traffic stops; NaN where the pickle does not say."""
    if light.get("metadata", {}).get("is_stop_point_assumed"):
        return np.full(3, np.nan)
    if "stop_point" in light["state"]:  # oldest form: one row per timestep, set where the lane is
        used = np.flatnonzero(np.asarray(light["state"]["lane"]).astype(bool))
        points = _points(light["state"]["stop_point"], ground, is_flat=False)
        return np.full(3, np.nan) if points is None or not len(used) else points[used[0]]
    points = _points(light.get("stop_point"), ground, is_flat=False)
    return np.full(3, np.nan) if points is None else points[0]
