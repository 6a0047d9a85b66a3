"""Check a pickled dictionary against the requirements of MetaDrive 0.4.3 and ScenarioNet.

Stricter than ``ScenarioDescription.sanity_check``: it also rejects what would make the simulator, the summaries or the
filters fail later. Derived by removing and damaging the fields of a real pickle one at a time.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from scenarionet_data.errors import InvalidScenario
from scenarionet_data.export.describe import TRACK_TYPES
from scenarionet_data.scenario.vocabulary import LightState

_LEVEL_1 = {
    "id": str,
    "version": str,
    "length": int,
    "tracks": dict,
    "dynamic_map_states": dict,
    "map_features": dict,
    "metadata": dict,
}
_METADATA = {
    "id": str,
    "dataset": str,
    "scenario_id": (str, int),
    "coordinate": str,
    "metadrive_processed": bool,
    "sdc_id": str,
    "ts": np.ndarray,
    "object_summary": dict,
    "number_summary": dict,
}
_PARTICIPANTS = ("VEHICLE", "PEDESTRIAN", "CYCLIST")
_LANES = ("LANE_SURFACE_STREET", "LANE_SURFACE_UNSTRUCTURE", "LANE_UNKNOWN", "LANE_FREEWAY", "LANE_BIKE_LANE")
_LINES = ("ROAD_LINE_", "UNKNOWN_LINE", "ROAD_EDGE_BOUNDARY", "ROAD_EDGE_MEDIAN")
_AREAS = ("CROSSWALK", "ROAD_EDGE_SIDEWALK")
_LIGHT_STATES = {None, *(state.name for state in LightState if state != LightState.ABSENT)}
_LEAVES = (int, float, str, bool, type(None), np.ndarray, tuple, set)
_MAX_CENTROID_DISTANCE = 100.0


def sanity_check(description: Mapping[str, Any]) -> None:
    """Check a scenario in ScenarioNet's format.

    Raises:
        InvalidScenario: With the first field that is missing or wrong.
    """
    check = _Check(str(description.get("id", "pickle")))
    check.that(type(description) is dict, "description", f"expected a plain dict, found {type(description).__name__}")
    for name, kind in _LEVEL_1.items():
        check.has(description, name, kind, name)
    _check_types(check, dict(description), "description")
    length = description["length"]
    check.that(length > 0, "length", f"expected at least one timestep, found {length}")
    for track_id, track in description["tracks"].items():
        _check_track(check, track, track_id, length)
    for lane_id, light in description["dynamic_map_states"].items():
        _check_light(check, light, lane_id, length)
    for feature_id, feature in description["map_features"].items():
        _check_feature(check, feature, f"map_features[{feature_id!r}]")
    _check_metadata(check, description)


class _Check:
    """Raises InvalidScenario for one description."""

    def __init__(self, scenario_id: str) -> None:
        self.scenario_id = scenario_id

    def that(self, is_met: bool | np.bool_, field: str, reason: str) -> None:
        if not is_met:
            raise InvalidScenario(self.scenario_id, field, reason)

    def has(self, mapping: Any, key: str, kind: Any, field: str) -> None:
        self.that(isinstance(mapping, dict), field, f"expected a dict around it, found {type(mapping).__name__}")
        self.that(key in mapping, field, "is missing")
        found = type(mapping[key]).__name__
        is_bool = isinstance(mapping[key], bool) and kind is int
        self.that(isinstance(mapping[key], kind) and not is_bool, field, f"expected {kind}, found {found}")

    def array(self, mapping: dict[str, Any], key: str, field: str, shapes: list[tuple[int, ...]]) -> None:
        self.has(mapping, key, np.ndarray, field)
        array = mapping[key]
        self.that(array.shape in shapes, field, f"expected shape {shapes[0]}, found {array.shape}")
        self.that(array.dtype.kind in "fbiu", field, f"expected numbers, found {array.dtype}")
        self.that(bool(np.isfinite(array).all()), field, "expected finite numbers")


def _check_types(check: _Check, value: dict[str, Any] | list[Any], field: str) -> None:
    """Check that dicts and lists contain builtins and arrays only."""
    items = value.items() if isinstance(value, dict) else enumerate(value)
    for key, inner in items:
        if isinstance(value, dict) and type(key) is not str:
            check.that(False, field, f"expected str keys, found {key!r}")
        if type(inner) in _LEAVES:
            continue
        if isinstance(inner, dict | list):
            _check_types(check, inner, f"{field}[{key!r}]")
        elif isinstance(inner, np.generic) or not isinstance(inner, _LEAVES):
            found = f"expected builtins and arrays, found {type(inner).__name__}"
            check.that(False, f"{field}[{key!r}]", found)


def _check_track(check: _Check, track: Any, track_id: str, length: int) -> None:
    field = f"tracks[{track_id!r}]"
    check.has(track, "type", str, f"{field}.type")
    check.that(track["type"] in TRACK_TYPES, f"{field}.type", f"expected one of {TRACK_TYPES}, found {track['type']}")
    check.has(track, "state", dict, f"{field}.state")
    state = track["state"]
    check.array(state, "position", f"{field}.state.position", [(length, 3)])
    check.array(state, "heading", f"{field}.state.heading", [(length,)])
    check.array(state, "velocity", f"{field}.state.velocity", [(length, 2)])
    check.array(state, "valid", f"{field}.state.valid", [(length,)])
    for name in ("length", "width", "height"):
        if track["type"] in _PARTICIPANTS or name in state:
            check.array(state, name, f"{field}.state.{name}", [(length,), (length, 1)])
    for name, values in state.items():
        is_series = isinstance(values, np.ndarray | list | tuple) and len(values) == length
        check.that(is_series, f"{field}.state.{name}", f"expected {length} values, one per timestep")
        is_flat = not isinstance(values, np.ndarray) or (values.ndim <= 2 and values.size > 0)
        check.that(is_flat, f"{field}.state.{name}", "expected one or two dimensions, none of them empty")
    _check_object_metadata(check, track, track_id, field)


def _check_object_metadata(check: _Check, described: dict[str, Any], object_id: str, field: str) -> None:
    check.has(described, "metadata", dict, f"{field}.metadata")
    check.has(described["metadata"], "type", str, f"{field}.metadata.type")
    check.has(described["metadata"], "object_id", str, f"{field}.metadata.object_id")
    same = described["metadata"]["object_id"] == object_id
    check.that(same, f"{field}.metadata.object_id", f"expected the key {object_id!r}")


def _check_light(check: _Check, light: Any, lane_id: str, length: int) -> None:
    field = f"dynamic_map_states[{lane_id!r}]"
    check.has(light, "type", str, f"{field}.type")
    check.that(light["type"] == "TRAFFIC_LIGHT", f"{field}.type", "expected TRAFFIC_LIGHT")
    check.has(light, "state", dict, f"{field}.state")
    check.has(light["state"], "object_state", (list, np.ndarray), f"{field}.state.object_state")
    states = list(light["state"]["object_state"])
    check.that(len(states) == length, f"{field}.state.object_state", f"expected {length} states, found {len(states)}")
    unknown = [state for state in states if state not in _LIGHT_STATES]
    check.that(not unknown, f"{field}.state.object_state", f"expected states MetaDrive knows, found {unknown[:1]}")
    check.has(light, "stop_point", (np.ndarray, list), f"{field}.stop_point")
    point = np.asarray(light["stop_point"])
    is_point = point.ndim == 1 and len(point) >= 2 and point.dtype.kind in "fi" and np.isfinite(point).all()
    check.that(is_point, f"{field}.stop_point", "expected two or three finite coordinates")
    _check_object_metadata(check, light, lane_id, field)


def _check_feature(check: _Check, feature: Any, field: str) -> None:
    check.has(feature, "type", str, f"{field}.type")
    kind = feature["type"]
    if kind in _LANES or kind.startswith(_LINES) or kind == "UNKNOWN" or "polyline" in feature:
        _check_points(check, feature, "polyline", field, minimum=1)
    if kind in _AREAS or "polygon" in feature:
        _check_points(check, feature, "polygon", field, minimum=3 if kind in _AREAS else 1)
    if kind in _LANES and "polygon" in feature:
        width = np.shape(feature["polygon"])[1]
        check.that(width == 2, f"{field}.polygon", f"expected a 2D lane polygon, found {width} coordinates")
    if "polyline" in feature and "polygon" in feature:
        centers = [np.asarray(feature[name])[:, :2].mean(axis=0) for name in ("polyline", "polygon")]
        distance = float(np.hypot(*(centers[0] - centers[1])))
        near = distance < _MAX_CENTROID_DISTANCE
        check.that(
            near, f"{field}.polygon", f"expected its centre within 100 m of the polyline's, found {distance:.0f}"
        )


def _check_points(check: _Check, feature: dict[str, Any], name: str, field: str, minimum: int) -> None:
    check.has(feature, name, (np.ndarray, list, tuple), f"{field}.{name}")
    try:
        points = np.asarray(feature[name], dtype=np.float64)
    except (TypeError, ValueError) as error:
        raise InvalidScenario(check.scenario_id, f"{field}.{name}", "expected numbers, (n, 2) or (n, 3)") from error
    is_list = points.ndim == 2 and points.shape[1] in (2, 3) and len(points) >= minimum
    check.that(is_list, f"{field}.{name}", f"expected (n, 2) or (n, 3), n >= {minimum}, found {points.shape}")
    check.that(bool(np.isfinite(points).all()), f"{field}.{name}", "expected finite numbers")


def _check_metadata(check: _Check, description: Mapping[str, Any]) -> None:
    metadata = description["metadata"]
    for name, kind in _METADATA.items():
        check.has(metadata, name, kind, f"metadata.{name}")
    check.array(metadata, "ts", "metadata.ts", [(description["length"],)])
    ego = metadata["sdc_id"]
    check.that(ego in description["tracks"], "metadata.sdc_id", f"expected a track, found {ego!r}")
    summaries = metadata["object_summary"]
    same = set(summaries) == set(description["tracks"])
    check.that(same, "metadata.object_summary", "expected one entry per track")
    for track_id, summary in summaries.items():
        check.has(summary, "moving_distance", float, f"metadata.object_summary[{track_id!r}].moving_distance")
    for name in ("num_objects", "num_traffic_lights"):
        check.has(metadata["number_summary"], name, int, f"metadata.number_summary.{name}")
