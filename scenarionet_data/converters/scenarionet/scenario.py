"""One pickle of any version as a scenario."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import replace
from pathlib import PurePath
from typing import Any

import numpy as np

from scenarionet_data.arrays.dtypes import Float64
from scenarionet_data.building.plausible import MAX_MAP_DISTANCE
from scenarionet_data.converters.scenarionet.frame import Frame, find_frame
from scenarionet_data.converters.scenarionet.layout import (
    LAYOUT,
    describe_features,
    describe_lights,
    describe_objects,
    describe_pickle,
    describe_tracks,
)
from scenarionet_data.converters.scenarionet.lights import make_lights
from scenarionet_data.converters.scenarionet.map_features import is_known, make_map
from scenarionet_data.converters.scenarionet.tracks import (
    is_wider,
    make_pickled_tracks,
    read_states,
    repair_ends,
    restore_ego_size,
)
from scenarionet_data.converters.scenarionet.usable import build_usable, drop_bad_states
from scenarionet_data.converters.scenarionet.values import to_plain
from scenarionet_data.errors import InvalidScenario
from scenarionet_data.ingest.defects import Defects
from scenarionet_data.ingest.shard import Shard
from scenarionet_data.scenario.canonical_json import to_json
from scenarionet_data.scenario.content_hash import content_hash
from scenarionet_data.scenario.description import Lights, MapFeatures, ScenarioDescription, Source, make_scenario_id
from scenarionet_data.scenario.validation import Validator, validate_lights, validate_map
from scenarionet_data.scenario.vocabulary import ObjectType
from scenarionet_data.statistics.summary import travelled

UNKNOWN_LICENCE = "licence of the original dataset"
_DT = 0.1
_LICENCES = {
    "waymo": "Waymo Dataset License Agreement for Non-Commercial Use",
    "nuscenes": "CC BY-NC-SA 4.0",
    "nuplan": "CC BY-NC-SA 4.0",
    "av2": "CC BY-NC-SA 4.0",
    "lyft": "CC BY-NC-SA 4.0",
    "metadrive": "Apache-2.0",
}
# Stored in the scenario's arrays or its source already.
_STORED = {
    "id", "dataset", "scenario_id", "sdc_id", "sdc_track_index", "ts", "sample_rate", "track_length",
    "current_time_index", "objects_of_interest", "tracks_to_predict", "origin", "has_z", "split", "scenario_uid",
    "old_origin_in_current_coordinate", "object_summary", "number_summary", "extras", "licence", "log_name", "map",
    "date", "crs", "omitted_map_features", "omitted_polygons",
}  # fmt: skip

_OURS = ("id", "dataset", "split", "scenario_uid", "source_file")
"""Metadata of this project's export that tells the scenario it was made from."""


def make_scenario(shard: Shard, where: str, description: dict[str, Any]) -> ScenarioDescription:
    """Convert a pickle; tracks, states, lights and map features that cannot be read are dropped.

    Args:
        shard: Its shard.
        where: Its file, relative to the raw folder.
        description: Its content.

    Raises:
        InvalidScenario, or an error of Python's for a field that is missing or of the wrong type.
    """
    metadata, length, defects = description["metadata"], description["length"], Defects()
    times = np.asarray(metadata["ts"], dtype=np.float64)
    if times.shape != (length,) or not length or not np.isfinite(times).all() or (np.diff(times) <= 0).any():
        raise InvalidScenario(where, "metadata.ts", f"expected {length} increasing times [s], found others")
    tracks, states = build_usable(
        "tracks", description["tracks"], lambda members: read_states(members, length, where), where, defects
    )
    ids = [str(track_id) for track_id in tracks]
    ego_id = str(metadata["sdc_id"])
    if ego_id not in ids:
        raise InvalidScenario(
            where, "metadata.sdc_id", f"expected a track that can be read, found none named {ego_id!r}"
        )
    ego = ids.index(ego_id)
    found: dict[str, list[str]] = {}
    for track_id, track in tracks.items():
        if track["type"] not in ObjectType.__members__:
            found.setdefault(str(track["type"]), []).append(f"track {track_id}")
    for word, names in found.items():
        defects.assume("tracks", where, names, "type", f"expected a type of MetaDrive's, found {word!r}")
    drop_bad_states(states, ids, ego, times, where, defects)
    features, has_heights = build_usable("maps", description["map_features"], _have_heights, where, defects)
    has_heights = has_heights or bool(states.position[..., 2][states.valid].any())
    frame = find_frame(description, states.position[ego], states.valid[ego], has_heights)
    known: Mapping[Any, Any] = {key: feature for key, feature in features.items() if is_known(feature)}
    known, (map_columns, map_features) = build_usable(
        "maps", known, lambda members: _make_map(members, frame, where), where, defects
    )
    _, (light_columns, lights) = build_usable(
        "lights",
        description["dynamic_map_states"],
        lambda members: _make_lights(members, length, known, frame, where),
        where,
        defects,
    )
    is_nuscenes = frame.dataset == "nuscenes" or description["version"].startswith("nuscenesv1.0")
    repaired = repair_ends(states, times, is_nuscenes and not frame.is_ours)
    own: list[dict[str, Any]] = [{} for _ in tracks]
    track_columns = {} if frame.is_ours else describe_tracks(tracks, states.is_size_assumed, own)
    is_swapped = is_nuscenes and is_wider(states, ego)
    if is_swapped:
        restore_ego_size(states, ego)
    if map_features is None and not frame.is_ours:
        defects.assume_empty_map(where)
    name = str(description.get("id", metadata.get("scenario_id")))
    named = [str(track_id) for track_id in metadata.get("objects_of_interest", ())]
    scenario = ScenarioDescription(
        id=make_scenario_id(shard.dataset, shard.version, f"{frame.dataset}_{name}"),
        dataset=shard.dataset,
        version=shard.version,
        split=shard.split,
        timestamps=times - times[0],
        dt=_time_step(metadata, times),
        current_timestep=int(metadata.get("current_time_index", np.argmax(states.valid[ego]))),
        ego_id=ego_id,
        origin=frame.origin,
        has_z=frame.has_z,
        source=_make_source(metadata, where, frame.dataset, name),
        tracks=make_pickled_tracks(tracks, states, frame, ego, own),
        lights=lights,
        map=map_features,
        objects_of_interest=tuple(_present(named, ids, "objects_of_interest", where, defects)),
        tracks_to_predict=_to_predict(metadata, ids, where, defects),
        extras=_make_extras(description, frame, name),
        defects=defects.found(),
    )
    if frame.is_ours:
        pickled = {"version": description["version"], **{key: metadata[key] for key in _OURS if key in metadata}}
    else:
        unknown = {key: feature for key, feature in features.items() if not is_known(feature)}
        layout = {
            **describe_pickle(description),
            "tracks": {**track_columns, "is_ego_swapped": is_swapped, **({"stops": repaired} if repaired else {})},
            "lights": light_columns,
            "map": {**map_columns, "moved": frame.moved.tolist()},
            "unknown_features": to_plain(unknown),
            "objects": describe_objects(
                metadata.get("object_summary"), tracks, scenario.tracks.valid, travelled(scenario.tracks)
            ),
        }
        pickled = {"layout": layout, "origin": frame.local_origin.tolist(), "content_hash": content_hash(scenario)}
    pickled["file"] = PurePath(where).name
    scenario = replace(scenario, extras={**scenario.extras, LAYOUT: pickled})
    str(to_json(scenario.extras)).encode()  # raises an error for text that is not Unicode, and numbers not in JSON
    return scenario


def _make_map(members: Mapping[Any, Any], frame: Frame, where: str) -> tuple[dict[str, Any], MapFeatures | None]:
    """Columns of the layout, and the map features."""
    own: list[dict[str, Any]] = [{} for _ in members]
    columns = {} if frame.is_ours else describe_features(members, frame.quirks == "nuscenes", own)
    made = make_map(members, frame, own)
    if made is not None:
        validator = Validator(where)
        validate_map(validator, made)
        reach = max(float(np.abs(lines.values).max(initial=0.0)) for lines in (made.polyline, made.polygon))
        expected = f"expected points within {MAX_MAP_DISTANCE:,.0f} m of the ego, found one at {reach:,.0f} m"
        validator.check(reach <= MAX_MAP_DISTANCE, "polyline", expected)
    return columns, made


def _make_lights(
    members: Mapping[Any, Any], length: int, features: Mapping[Any, Any], frame: Frame, where: str
) -> tuple[dict[str, Any], Lights]:
    """Columns of the layout, and the lights."""
    lights = make_lights(members, length, features, frame, where)
    validate_lights(Validator(where), lights, length)
    return {} if frame.is_ours else describe_lights(members), lights


def _have_heights(features: Mapping[Any, Any]) -> bool:
    """Whether any line has heights; raises an error for a feature without a type, or whose line cannot be read."""
    typed = [(feature["type"], feature.get("polyline", ())) for feature in features.values()]
    return any(len(line) and len(line[0]) == 3 and np.asarray(line)[:, 2].any() for _, line in typed)


def _to_predict(
    metadata: Mapping[str, Any], ids: list[str], where: str, defects: Defects
) -> tuple[tuple[str, int], ...]:
    named = dict(_tracks_to_predict(metadata.get("tracks_to_predict", {})))
    return tuple((track_id, named[track_id]) for track_id in _present(named, ids, "tracks_to_predict", where, defects))


def _present(named: Iterable[str], ids: list[str], field: str, where: str, defects: Defects) -> list[str]:
    """The named tracks that the scenario has."""
    known = set(ids)
    missing = [f"track {track_id}" for track_id in named if track_id not in known]
    defects.drop("metadata", where, missing, field, "expected a track that can be read, found none")
    return [track_id for track_id in named if track_id in known]


def _time_step(metadata: Mapping[str, Any], times: Float64) -> float:
    """Return the nominal timestep [s]: of the pickle, else the median rounded to a millisecond."""
    if metadata.get("sample_rate"):
        return float(metadata["sample_rate"])
    return round(float(np.median(np.diff(times))), 3) if len(times) > 1 else _DT


def _tracks_to_predict(predicted: Any) -> tuple[tuple[str, int], ...]:
    """Return pairs of track and difficulty, from Waymo's records by track id or from a list of ids."""
    if isinstance(predicted, Mapping):
        return tuple((str(i), int(record.get("difficulty") or 0)) for i, record in predicted.items())
    return tuple((str(track_id), 0) for track_id in predicted)


def _make_source(metadata: Mapping[str, Any], where: str, dataset: str, name: str) -> Source:
    def told(key: str) -> str | None:
        return str(metadata[key]) if metadata.get(key) is not None else None

    return Source(
        scenario_id=told("source_scenario_id") or name,
        file=where,
        licence=told("licence") or _LICENCES.get(dataset, UNKNOWN_LICENCE),
        log=told("log_name"),
        city=told("map"),
        date=told("date"),
        crs=told("crs"),
    )


def _make_extras(description: Mapping[str, Any], frame: Frame, name: str) -> dict[str, Any]:
    """Return extras: those of this project's export; of others the pickle's name and metadata without a column."""
    metadata = description["metadata"]
    if frame.is_ours:
        return dict(metadata.get("extras", {}))
    rest = {
        str(key): value
        for key, value in metadata.items()
        if key not in _STORED
        and (value is None or type(value) in (str, int, bool) or (type(value) is float and math.isfinite(value)))
    }
    return {
        "dataset": frame.dataset,
        "version": str(description["version"]),
        "id": name,
        **({"metadata": rest} if rest else {}),
    }
