"""Write a scenario that was converted from a pickle as the pickle was: frame, names, dtypes, containers, placeholders.

The converter records how the pickle writes each field (``converters/scenarionet/layout.py``); values come from the
scenario's arrays. What cannot be the same is listed in ``docs/guides/pickles.md``.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np

from scenarionet_data.arrays.dtypes import Array, Float64
from scenarionet_data.arrays.ragged import Ragged
from scenarionet_data.converters.boundary_segments import to_records
from scenarionet_data.converters.scenarionet.columns import OWN, is_literal, unpack, value_of
from scenarionet_data.converters.scenarionet.layout import LAYOUT, LINES, LINKS, SIZES
from scenarionet_data.converters.scenarionet.values import from_plain
from scenarionet_data.export.summary import summarize_object
from scenarionet_data.scenario.canonical_json import from_json
from scenarionet_data.scenario.content_hash import content_hash
from scenarionet_data.scenario.description import MapFeatures, ScenarioDescription
from scenarionet_data.scenario.vocabulary import LightState, MapFeatureType, names

_FEATURE_TYPES = names(MapFeatureType)
_LIGHT_STATES = names(LightState)
_LIGHT_STATES[LightState.ABSENT] = None


def to_original_dict(scenario: ScenarioDescription) -> dict[str, Any] | None:
    """Return the pickle that a scenario was converted from.

    Returns:
        None if it was converted from something else, or has been changed since.
    """
    pickled = scenario.extras.get(LAYOUT, {})
    if "layout" not in pickled or pickled["content_hash"] != content_hash(scenario):
        return None
    layout, origin = pickled["layout"], np.array(pickled["origin"])
    tracks = dict(_tracks(scenario, layout, origin))
    times = (scenario.timestamps + layout["ts"]["first"]).astype(layout["ts"]["dtype"])
    description = {
        **from_plain(layout["description"]),
        "length": scenario.num_timesteps,
        "tracks": tracks,
        "dynamic_map_states": dict(_lights(scenario, layout["lights"], origin)),
        "map_features": _map(scenario.map, layout, origin),
        "metadata": {**from_plain(layout["metadata"]), "ts": times.tolist() if layout["ts"]["is_list"] else times},
    }
    if layout["objects"] is not None:
        description["metadata"]["object_summary"] = _objects(layout["objects"], tracks)
    return description


def _members(columns: Mapping[str, Any], count: int) -> list[dict[str, str]]:
    """Forms by name of each member."""
    found: list[dict[str, str]] = [{} for _ in range(count)]
    for name, column in columns.items():
        for forms, form in zip(found, unpack(column, count), strict=True):
            if form is not None:
                forms[name] = form
    return found


def _id(form: str | None, identifier: str) -> Any:
    return int(identifier) if form == "int" else identifier


def _tracks(scenario: ScenarioDescription, layout: Mapping[str, Any], origin: Float64) -> Iterator[tuple[Any, Any]]:
    tracks, columns, count = scenario.tracks, layout["tracks"], len(scenario.tracks)
    valid = tracks.valid[..., None]
    velocity = tracks.velocity.copy()
    for row, step in columns.get("stops", ()):
        velocity[row, step] = 0.0
    length, width, height = np.moveaxis(tracks.size, -1, 0).copy()
    if columns["is_ego_swapped"]:
        ego = scenario.ego_index
        length[ego], width[ego] = np.minimum(length[ego], width[ego]), np.maximum(length[ego], width[ego])
    arrays = {
        "position": np.where(valid, tracks.position + origin, 0.0),
        "heading": tracks.heading,
        "velocity": velocity,
        "valid": tracks.valid,
        **dict(zip(SIZES, (length, width, height), strict=True)),
    }
    rows = zip(
        tracks.ids, tracks.extras, unpack(columns["ids"], count),
        _members(columns["state"], count), _members(columns["track"], count), strict=True,
    )  # fmt: skip
    for row, (track_id, extras, id_form, states, fields) in enumerate(rows):
        own = from_plain(from_json(extras).get(LAYOUT, {}))
        state = {name: _state(arrays[name][row], form) for name, form in states.items() if form != OWN}
        metadata = {
            name.removeprefix("metadata."): _literal_or_id(form, track_id)
            for name, form in fields.items()
            if name != "type" and form != OWN
        }
        yield (
            _id(id_form, track_id),
            {
                "type": value_of(fields["type"]),
                "state": state | own.get("state", {}),
                "metadata": metadata | own.get("metadata", {}),
                **own.get("track", {}),
            },
        )


def _state(values: Array, form: str) -> Array:
    """An array (T,), (T, 1), (T, 2) or (T, 3) of its own."""
    dtype, *shape = form.split()
    if not shape:
        return np.array(values, dtype)
    return np.array(values.reshape(len(values), -1)[:, : int(shape[0])], dtype)


def _literal_or_id(form: str, identifier: str) -> Any:
    return value_of(form) if is_literal(form) else _id(form, identifier)


def _lights(scenario: ScenarioDescription, columns: Mapping[str, Any], origin: Float64) -> Iterator[tuple[Any, Any]]:
    lights, count = scenario.lights, len(scenario.lights)
    points = lights.stop_point + origin
    rows = zip(lights.lane_ids, unpack(columns["ids"], count), _members(columns["light"], count), strict=True)
    for row, (lane_id, id_form, fields) in enumerate(rows):
        light: dict[str, Any] = {"state": {}}
        for name, form in fields.items():
            part, _, inner = name.rpartition(".")
            target = light.setdefault(part, {}) if part else light
            if name == "stop_point" and not is_literal(form):
                target[inner] = _point(points[row], form)
            elif name == "state.object_state" and not is_literal(form):
                target[inner] = _states(_LIGHT_STATES[lights.state[row]], form)
            else:
                target[inner] = _literal_or_id(form, lane_id)
        yield _id(id_form, lane_id), light


def _states(words: Array, form: str) -> Any:
    if form in ("list", "tuple"):
        return words.tolist() if form == "list" else tuple(words.tolist())
    return words.astype(form)


def _map(features: MapFeatures | None, layout: Mapping[str, Any], origin: Float64) -> dict[Any, Any]:
    """Map features, with those of unknown types, which the lake keeps in the layout only."""
    described: dict[Any, Any] = from_plain(layout["unknown_features"])
    if features is None:
        return described
    columns, count = layout["map"], len(features)
    lines = {
        "polyline": Ragged(features.polyline.offsets, features.polyline.values + origin),
        "polygon": Ragged(features.polygon.offsets, features.polygon.values + origin),
        "position": Ragged(features.polyline.offsets, features.polyline.values + (origin - columns["moved"])),
    }
    rows = zip(
        features.ids, features.extras, unpack(columns["ids"], count), _members(columns["feature"], count), strict=True
    )
    for row, (feature_id, text, id_form, fields) in enumerate(rows):
        extras = from_json(text)
        own = from_plain(extras.get(LAYOUT, {}))
        feature = {
            name: _feature_field(features, row, name, form, lines, extras, own.get("thirds", {}))
            for name, form in fields.items()
            if form != OWN
        }
        described[_id(id_form, feature_id)] = feature | own.get("feature", {})
    return described


def _feature_field(
    features: MapFeatures,
    row: int,
    name: str,
    form: str,
    lines: Mapping[str, Ragged],
    extras: Mapping[str, Any],
    thirds: Mapping[str, Any],
) -> Any:
    if is_literal(form):
        return value_of(form)
    if name == "type":
        return str(_FEATURE_TYPES[features.feature_type[row]])
    if name in LINES:
        points = lines[name][row]
        if name in thirds:
            points = np.column_stack([points[:, :2], np.cumsum(thirds[name]) / 1e6])
        return _line(points, form)
    if name == "width":
        dtype, _, *zeros = form.split()
        if zeros:
            return np.zeros((len(features.polyline[row]), 2), dtype)
        return np.array(features.width[row], dtype)
    if form == "records":
        return to_records({name: extras[name]})[name]
    return [_id(form, str(item)) for item in getattr(features, LINKS[name])[row]]


def _line(points: Float64, form: str) -> Any:
    """Points in their container: an array, a point, or a list or tuple of arrays, lists or tuples."""
    container, *rest = form.split()
    if container == "point":
        return _point(points[0], form)
    if len(rest) == 1:
        return np.array(points[:, : int(rest[0])], container)
    kind, inner = rest[1], points[:, : int(rest[2])]
    if kind in ("list", "tuple"):
        made: list[Any] = [tuple(point) if kind == "tuple" else point for point in inner.tolist()]
    else:
        made = list(inner.astype(kind))
    return tuple(made) if container == "tuple" else made


def _point(point: Float64, form: str) -> Any:
    _, container, width = form.split()
    numbers = point[: int(width)]
    if container in ("list", "tuple"):
        return numbers.tolist() if container == "list" else tuple(numbers.tolist())
    return np.array(numbers, container)


def _objects(layout: Mapping[str, Any], tracks: Mapping[Any, Any]) -> dict[Any, Any]:
    summary: dict[Any, Any] = from_plain(layout["others"])
    for (track_id, track), forms in zip(tracks.items(), _members(layout["columns"], len(tracks)), strict=True):
        if forms:
            known = summarize_object(str(track_id), track)
            known["distance"] = known["moving_distance"]
            summary[track_id] = {
                name: known[form] if form in known else _literal_or_id(form, str(track_id))
                for name, form in forms.items()
            }
    return summary
