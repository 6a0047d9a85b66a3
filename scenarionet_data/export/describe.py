"""Convert a scenario to the plain dictionary that ScenarioNet pickles: tracks, metadata and names.

Every value is a builtin or a separate writable array. Coordinates stay in the scenario frame (float32);
``metadata["origin"]`` is its position in the source frame. Additional keys store data without a place in ScenarioNet's
format; its readers ignore them, this project's converter reads them back.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any
from urllib.parse import quote

import numpy as np

from scenarionet_data.converters.scenarionet.layout import LAYOUT
from scenarionet_data.errors import InvalidScenario
from scenarionet_data.export.maps import describe_lights, describe_map, is_flat
from scenarionet_data.export.summary import summarize
from scenarionet_data.scenario.canonical_json import from_json, to_json
from scenarionet_data.scenario.description import ScenarioDescription
from scenarionet_data.scenario.vocabulary import ObjectType, names

TRACK_TYPES = ("VEHICLE", "PEDESTRIAN", "CYCLIST", "OTHER", "TRAFFIC_CONE", "TRAFFIC_BARRIER")
"""Track types that MetaDrive accepts; all others become OTHER, which it skips."""

_OBJECT_TYPES = names(ObjectType)


@dataclass(frozen=True)
class Identity:
    """Name of a scenario in ScenarioNet.

    Attributes:
        dataset, version, id: As in the pickle; a scenario converted from a pickle has its original ones.
        original_file: Name of the pickle that it was converted from; empty for others.
    """

    dataset: str
    version: str
    id: str
    original_file: str = ""

    @property
    def file_name(self) -> str:
        """Name of the scenario's file."""
        return self.original_file or self.standard_name

    @property
    def standard_name(self) -> str:
        """``sd_{dataset}_{version}_{id}.pkl``, as recognised by MetaDrive."""
        return f"sd_{_escape(self.dataset)}_{_escape(self.version)}_{_escape(self.id)}.pkl"


def _escape(text: str) -> str:
    return quote(text, safe="@%")


def identify(scenario: ScenarioDescription) -> Identity:
    """Return the scenario's name in ScenarioNet.

    Raises:
        InvalidScenario: It was converted from a pickle, but its extras lack the original name.
    """
    if scenario.dataset == "scenarionet":
        kept = {**scenario.extras, **scenario.extras.get(LAYOUT, {})}
        missing = [key for key in ("dataset", "version", "id") if key not in kept]
        if missing:
            raise InvalidScenario(scenario.id, f"extras.{missing[0]}", "expected the name of the original pickle")
        return Identity(str(kept["dataset"]), str(kept["version"]), str(kept["id"]), str(kept.get("file", "")))
    dataset, version, name = scenario.id.split("/")
    return Identity(dataset, version, name)


def to_pickle_dict(scenario: ScenarioDescription) -> dict[str, Any]:
    """Convert a scenario to ScenarioNet's dictionary.

    Args:
        scenario: A valid scenario; arrays are copied.

    Returns:
        Dictionary with ``id``, ``version``, ``length``, ``tracks``, ``dynamic_map_states``, ``map_features`` and
        ``metadata``, summaries included.
    """
    identity = identify(scenario)
    map_features, omitted = describe_map(scenario.map, flat=is_flat(scenario))
    description: dict[str, Any] = {
        "id": identity.id,
        "version": identity.version,
        "length": scenario.num_timesteps,
        "tracks": _describe_tracks(scenario, identity),
        "dynamic_map_states": describe_lights(scenario, identity.dataset),
        "map_features": map_features,
        "metadata": _describe_metadata(scenario, identity) | omitted,
    }
    description["metadata"].update(summarize(description))
    return description


def _describe_tracks(scenario: ScenarioDescription, identity: Identity) -> dict[str, Any]:
    tracks = scenario.tracks
    arrays = {name: np.array(getattr(tracks, name)) for name in ("position", "heading", "velocity", "valid")}
    # One contiguous array per dimension, so that a track's row is a plain (T,) array.
    length, width, height = np.array(np.moveaxis(tracks.size, -1, 0), order="C")
    arrays |= {"length": length, "width": width, "height": height}
    if is_ego_swapped(identity.dataset, identity.version):
        long, wide = length[scenario.ego_index], width[scenario.ego_index]
        is_longer = long > wide  # MetaDrive exchanges them back if width > length
        long[is_longer], wide[is_longer] = wide[is_longer], long[is_longer]
    described = {}
    for row, track_id in enumerate(tracks.ids):
        word = str(_OBJECT_TYPES[tracks.object_type[row]])
        kind = word if word in TRACK_TYPES else "OTHER"
        source_type = tracks.source_type[row]
        metadata: dict[str, Any] = {
            "track_length": scenario.num_timesteps,
            "type": kind if source_type is None else str(source_type),
            "object_id": str(track_id),
            "dataset": identity.dataset,
            "object_type": word,
            "source_type": None if source_type is None else str(source_type),
            "is_size_assumed": bool(tracks.is_size_assumed[row]),
            "is_type_assumed": bool(tracks.is_type_assumed[row]),
            "is_velocity_estimated": bool(tracks.is_velocity_estimated[row]),
        }
        if tracks.is_interpolated[row].any():
            metadata["is_interpolated"] = np.array(tracks.is_interpolated[row])
        if tracks.extras[row]:
            metadata["extras"] = from_json(tracks.extras[row])
        state = {name: array[row] for name, array in arrays.items()}
        described[str(track_id)] = {"type": kind, "state": state, "metadata": metadata}
    return described


def is_ego_swapped(dataset: str, version: str) -> bool:
    """Whether MetaDrive exchanges the ego's length and width, as written by ScenarioNet's nuScenes converter."""
    return dataset == "nuscenes" or version.startswith("nuscenesv1.0")


def _describe_metadata(scenario: ScenarioDescription, identity: Identity) -> dict[str, Any]:
    tracks = scenario.tracks
    types = [str(word) if word in TRACK_TYPES else "OTHER" for word in _OBJECT_TYPES[tracks.object_type]]
    metadata: dict[str, Any] = {
        "id": identity.id,
        "dataset": identity.dataset,
        "scenario_id": identity.id,
        "coordinate": "right-handed",
        "metadrive_processed": False,
        "sdc_id": str(scenario.ego_id),
        "sdc_track_index": scenario.ego_index,
        "ts": np.array(scenario.timestamps),
        "sample_rate": float(scenario.dt),
        "track_length": scenario.num_timesteps,
        "current_time_index": int(scenario.current_timestep),
        "objects_of_interest": [str(track_id) for track_id in scenario.objects_of_interest],
        "tracks_to_predict": {
            str(track_id): {
                "track_index": (row := tracks.index(track_id)),
                "track_id": str(track_id),
                "difficulty": int(difficulty),
                "object_type": types[row],
            }
            for track_id, difficulty in scenario.tracks_to_predict
        },
        "origin": np.array(scenario.origin),
        "has_z": bool(scenario.has_z),
        "split": scenario.split,
        "scenario_uid": scenario.id,
    }
    extras = {key: value for key, value in scenario.extras.items() if key != LAYOUT}
    if extras:
        metadata["extras"] = from_json(to_json(extras))
    # Of a scenario that was exported before: those of the scenario it was exported from.
    first = {key: scenario.extras.get(LAYOUT, {}).get(key) for key in ("split", "scenario_uid", "source_file")}
    source = scenario.source
    described = {
        "source_scenario_id": source.scenario_id,
        "source_file": source.file,
        "licence": source.licence,
        "log_name": source.log,
        "map": source.city,
        "date": source.date,
        "crs": source.crs,
    }
    metadata |= {key: str(value) for key, value in described.items() if value is not None}
    return metadata | {key: value for key, value in first.items() if value}
