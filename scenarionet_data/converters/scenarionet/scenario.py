"""One pickle of any version as a scenario."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import PurePath
from typing import Any

import numpy as np

from scenarionet_data.arrays.dtypes import Float64
from scenarionet_data.converters.scenarionet.frame import Frame, find_frame
from scenarionet_data.converters.scenarionet.layout import (
    LAYOUT,
    Own,
    describe_layout,
    describe_objects,
)
from scenarionet_data.converters.scenarionet.lights import make_lights
from scenarionet_data.converters.scenarionet.map_features import is_known, make_map
from scenarionet_data.converters.scenarionet.tracks import (
    States,
    is_wider,
    make_pickled_tracks,
    read_states,
    restore_ego_size,
)
from scenarionet_data.ingest.shard import Shard
from scenarionet_data.scenario.content_hash import content_hash
from scenarionet_data.scenario.description import ScenarioDescription, Source, make_scenario_id
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
    """Convert a pickle.

    Args:
        shard: Its shard.
        where: Its file, relative to the raw folder.
        description: Its content.

    Raises:
        InvalidScenario, or an error of Python's for a field that is missing or of the wrong type.
    """
    metadata, tracks = description["metadata"], description["tracks"]
    states = read_states(tracks, description["length"], where)
    ego_id = str(metadata["sdc_id"])
    ego = [str(track_id) for track_id in tracks].index(ego_id)
    frame = find_frame(description, states.position[ego], states.valid[ego], _has_heights(states, description))
    known = {key: feature for key, feature in description["map_features"].items() if is_known(feature)}
    own = Own.of(tracks, known)
    is_swapped = (frame.dataset == "nuscenes" or description["version"].startswith("nuscenesv1.0")) and is_wider(
        states, ego
    )
    layout = None if frame.is_ours else describe_layout(description, known, frame, states.is_size_assumed, own)
    if is_swapped:
        restore_ego_size(states, ego)
    times = np.asarray(metadata["ts"], dtype=np.float64)
    name = str(description.get("id", metadata.get("scenario_id")))
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
        tracks=make_pickled_tracks(tracks, states, frame, ego, own.tracks),
        lights=make_lights(description, frame, where),
        map=make_map(known, frame, own.features),
        objects_of_interest=tuple(str(track_id) for track_id in metadata.get("objects_of_interest", ())),
        tracks_to_predict=_tracks_to_predict(metadata.get("tracks_to_predict", {})),
        extras=_make_extras(description, frame, name),
    )
    if layout is None:
        pickled = {"version": description["version"], **{key: metadata[key] for key in _OURS if key in metadata}}
    else:
        layout["tracks"]["is_ego_swapped"] = is_swapped
        layout["objects"] = describe_objects(
            metadata.get("object_summary"), tracks, scenario.tracks.valid, travelled(scenario.tracks)
        )
        pickled = {"layout": layout, "origin": frame.local_origin.tolist(), "content_hash": content_hash(scenario)}
    pickled["file"] = PurePath(where).name
    return replace(scenario, extras={**scenario.extras, LAYOUT: pickled})


def _has_heights(states: States, description: Mapping[str, Any]) -> bool:
    if states.position[..., 2][states.valid].any():
        return True
    lines = (feature.get("polyline", ()) for feature in description["map_features"].values())
    return any(len(line) and len(line[0]) == 3 and np.asarray(line)[:, 2].any() for line in lines)


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
    rest = {str(key): value for key, value in metadata.items() if key not in _STORED and _is_simple(value)}
    return {
        "dataset": frame.dataset,
        "version": str(description["version"]),
        "id": name,
        **({"metadata": rest} if rest else {}),
    }


def _is_simple(value: Any) -> bool:
    return value is None or type(value) in (str, int, float, bool)


