"""Typed arrays to table rows and back, bit for bit: the one package that knows both.

``encode`` takes whole arrays apart and ``decode`` scatters them back without a Python loop over objects or
timesteps. Rows are the rows of ``schemas/*.toml``.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt
import pyarrow as pa

from scenarionet_data import tables
from scenarionet_data.codec.arrow import LoadedRows, Rows
from scenarionet_data.codec.content_hash import content_hash
from scenarionet_data.codec.lights import decode_lights, encode_lights
from scenarionet_data.codec.maps import decode_map, encode_map
from scenarionet_data.codec.tracks import decode_tracks, encode_tracks
from scenarionet_data.jsontext import from_json, to_json
from scenarionet_data.scenario import MapFeatures, ScenarioDescription, Source
from scenarionet_data.statistics import summarise

__all__ = [
    "Encoded",
    "LoadedRows",
    "decode",
    "decode_lights",
    "decode_map",
    "decode_tracks",
    "encode",
    "encode_map",
]

Array = npt.NDArray[Any]


@dataclass(frozen=True)
class Encoded:
    """One scenario as rows.

    Attributes:
        metadata: One row of the metadata table, without the address columns.
        tracks, lights: Rows of these tables; None where there are no lights.
        maps: Rows of the scenario's own map; None without one, or when the map is shared.
    """

    metadata: Mapping[str, Any]
    tracks: Rows
    lights: Rows | None
    maps: Rows | None


def encode(scenario: ScenarioDescription, converter_version: str) -> Encoded:
    """Rows of a valid scenario.

    Args:
        scenario: In canonical form (``validate()`` passes).
        converter_version: Goes into the metadata row.
    """
    tracks = encode_tracks(scenario.id, scenario.tracks, scenario.has_z)
    lights = encode_lights(scenario.id, scenario.lights, scenario.has_z)
    maps = None
    if scenario.map is not None and scenario.map_id is None:
        maps = encode_map(scenario.id, scenario.map, scenario.origin, scenario.has_z)
    metadata = {
        **_describe(scenario),
        "content_hash": content_hash(scenario),
        "converter_version": converter_version,
        **summarise(scenario),
    }
    return Encoded(metadata, tracks, lights, maps)


def decode(encoded: Encoded, shared_map: MapFeatures | None = None) -> ScenarioDescription:
    """The scenario behind its rows.

    Args:
        encoded: Rows; ``metadata`` needs ``tables.DESCRIPTION_COLUMNS`` only.
        shared_map: The crop of the shared map, already in the scenario's frame.
    """
    row = encoded.metadata
    steps = row["num_timesteps"]
    return ScenarioDescription(
        id=row["scenario_id"],
        dataset=row["dataset"],
        version=row["version"],
        split=row["split"],
        timestamps=_timestamps(row),
        dt=row["dt"],
        current_timestep=row["current_timestep"],
        ego_id=row["ego_id"],
        origin=np.array([row["origin_x"], row["origin_y"], row["origin_z"]]),
        has_z=row["has_z"],
        source=Source(
            scenario_id=row["source_scenario_id"],
            file=row["source_file"],
            licence=row["licence"],
            log=row["source_log"],
            city=row["city"],
            date=row["date"],
            crs=row["crs"],
        ),
        tracks=decode_tracks(encoded.tracks, steps),
        lights=decode_lights(encoded.lights, steps),
        map=shared_map if row["map_crop"] is not None else _own_map(row, encoded.maps),
        map_id=row["map_id"] if row["map_crop"] is not None else None,
        map_crop=tuple(row["map_crop"]) if row["map_crop"] is not None else None,
        objects_of_interest=tuple(row["objects_of_interest"]),
        tracks_to_predict=tuple(zip(row["tracks_to_predict"], row["tracks_to_predict_difficulty"], strict=True)),
        extras=from_json(row["extras"]),
    )


def _own_map(row: Mapping[str, Any], rows: Rows | None) -> MapFeatures | None:
    if row["map_id"] is None:
        return None
    # A map without features has no rows.
    return decode_map(pa.RecordBatch.from_pylist([], tables.load("maps").schema) if rows is None else rows)


def _describe(scenario: ScenarioDescription) -> dict[str, Any]:
    source = scenario.source
    regular = np.array_equal(scenario.timestamps, np.arange(scenario.num_timesteps) * scenario.dt)
    own_map = scenario.id if scenario.map is not None else None
    return {
        "scenario_id": scenario.id,
        "dataset": scenario.dataset,
        "version": scenario.version,
        "split": scenario.split,
        "source_scenario_id": source.scenario_id,
        "source_file": source.file,
        "source_log": source.log,
        "city": source.city,
        "date": source.date,
        "licence": source.licence,
        "origin_x": float(scenario.origin[0]),
        "origin_y": float(scenario.origin[1]),
        "origin_z": float(scenario.origin[2]),
        "crs": source.crs,
        "has_z": bool(scenario.has_z),
        "num_timesteps": scenario.num_timesteps,
        "dt": float(scenario.dt),
        "timestamps": None if regular else scenario.timestamps.tolist(),
        "current_timestep": int(scenario.current_timestep),
        "ego_id": scenario.ego_id,
        "objects_of_interest": list(scenario.objects_of_interest),
        "tracks_to_predict": [track_id for track_id, _ in scenario.tracks_to_predict],
        "tracks_to_predict_difficulty": [level for _, level in scenario.tracks_to_predict],
        "map_id": scenario.map_id or own_map,
        "map_crop": list(scenario.map_crop) if scenario.map_crop is not None else None,
        "extras": to_json(scenario.extras),
    }


def _timestamps(row: Mapping[str, Any]) -> Array:
    if row["timestamps"] is None:
        regular: Array = np.arange(row["num_timesteps"]) * row["dt"]
        return regular
    return np.array(row["timestamps"], dtype=np.float64)
