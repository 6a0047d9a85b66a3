"""Encode scenarios as table rows and decode them, bit for bit, without Python loops over objects or timesteps.

The columns of the rows are declared in ``schemas/*.toml``.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from operator import itemgetter
from typing import Any

import numpy as np
import pyarrow as pa

from scenarionet_data.arrays.columns import from_arrow
from scenarionet_data.arrays.dtypes import Array
from scenarionet_data.arrays.memory import Memory
from scenarionet_data.codec.lights import StoredLights, encode_lights, no_lights
from scenarionet_data.codec.maps import StoredFeatures, check_points, encode_map
from scenarionet_data.codec.stored_part import LAYOUTS, ScenarioColumns, codes
from scenarionet_data.codec.tracks import StoredTracks, check_lists, encode_tracks
from scenarionet_data.scenario.canonical_json import from_json, to_json
from scenarionet_data.scenario.content_hash import content_hash
from scenarionet_data.scenario.description import Lights, MapFeatures, ScenarioDescription, Source, Tracks
from scenarionet_data.statistics import summarise

__all__ = [
    "LAYOUTS",
    "Encoded",
    "ScenarioColumns",
    "check_lists",
    "check_points",
    "codes",
    "decode",
    "decode_many",
    "decode_map",
    "decode_tracks",
    "encode",
    "encode_map",
]


@dataclass(frozen=True)
class Encoded:
    """One scenario as rows.

    Attributes:
        metadata: Row of the metadata table, without the address columns.
        tracks, lights: Rows of these tables; None without lights.
        maps: Rows of the scenario's own map; None without a map, or when the map is shared.
    """

    metadata: Mapping[str, Any]
    tracks: pa.RecordBatch
    lights: pa.RecordBatch | None
    maps: pa.RecordBatch | None


def encode(scenario: ScenarioDescription, converter_version: str) -> Encoded:
    """Encode a valid scenario.

    Args:
        scenario: In canonical form (``validate()`` passes).
        converter_version: Value of the metadata column.
    """
    tracks = encode_tracks(scenario.id, scenario.tracks, scenario.has_z)
    lights = encode_lights(scenario.id, scenario.lights, scenario.has_z)
    maps = None
    if scenario.map is not None and scenario.map_id is None:
        maps = encode_map(scenario.id, scenario.map, scenario.origin, scenario.has_z)
    source = scenario.source
    regular = np.array_equal(scenario.timestamps, np.arange(scenario.num_timesteps) * scenario.dt)
    own_map = scenario.id if scenario.map is not None else None
    metadata = {
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
        "tracks_to_predict": list(map(itemgetter(0), scenario.tracks_to_predict)),
        "tracks_to_predict_difficulty": list(map(itemgetter(1), scenario.tracks_to_predict)),
        "map_id": scenario.map_id or own_map,
        "map_crop": list(scenario.map_crop) if scenario.map_crop is not None else None,
        "extras": to_json(scenario.extras),
        "content_hash": content_hash(scenario),
        "converter_version": converter_version,
        **summarise(scenario),
    }
    return Encoded(metadata, tracks, lights, maps)


def decode(encoded: Encoded, shared_map: MapFeatures | None = None) -> ScenarioDescription:
    """Decode one scenario.

    Args:
        encoded: Its rows; of ``metadata`` only ``tables.DESCRIPTION_COLUMNS`` are needed.
        shared_map: Crop of the shared map, in the scenario's frame.
    """
    lights = _rows("lights", encoded.lights) if encoded.lights is not None else None
    maps = _rows("maps", encoded.maps) if encoded.maps is not None else None
    (scenario,) = decode_many([encoded.metadata], _rows("tracks", encoded.tracks), lights, maps, [shared_map])
    return scenario


def decode_many(
    metadata: Sequence[Mapping[str, Any]],
    tracks: ScenarioColumns,
    lights: ScenarioColumns | None,
    maps: ScenarioColumns | None,
    shared_maps: Sequence[MapFeatures | None],
) -> list[ScenarioDescription]:
    """Decode several scenarios together.

    Args:
        metadata: Row of each scenario, with ``tables.DESCRIPTION_COLUMNS``.
        tracks: Rows of the tracks table.
        lights, maps: Rows of these tables; None when there are no rows.
        shared_maps: Crop of each scenario's shared map, in its frame; None for scenarios with their own map.

    Raises:
        LakeError: Rows are inconsistent: a file is damaged.
    """
    scenarios = []
    for number, (row, features) in enumerate(zip(metadata, shared_maps, strict=True)):
        steps, crop = row["num_timesteps"], row["map_crop"]
        if crop is None and row["map_id"] is not None:  # a map without features has no rows
            features = MapFeatures.read({}, StoredFeatures(maps, number, steps)) if maps else MapFeatures.empty()
        values = {
            "id": row["scenario_id"],
            "dataset": row["dataset"],
            "version": row["version"],
            "split": row["split"],
            "dt": row["dt"],
            "current_timestep": row["current_timestep"],
            "ego_id": row["ego_id"],
            "has_z": row["has_z"],
            "tracks": Tracks.read({}, StoredTracks(tracks, number, steps)),
            "lights": Lights.read({}, StoredLights(lights, number, steps)) if lights else no_lights(steps),
            "map": features,
            "map_id": row["map_id"] if crop is not None else None,
            "map_crop": tuple(crop) if crop is not None else None,
            "defects": (),
            "num_recorded_rows": None,
        }
        scenarios.append(ScenarioDescription.read(values, _Described(row)))
    return scenarios


def decode_tracks(rows: ScenarioColumns, steps: Sequence[int]) -> list[Tracks]:
    """Decode the tracks of scenarios alone.

    Args:
        rows: Rows of the tracks table.
        steps: (scenarios) number of timesteps.

    Raises:
        LakeError: Lists do not match their spans, or spans exceed the scenario: the file is damaged.
    """
    return [Tracks.read({}, StoredTracks(rows, number, count)) for number, count in enumerate(steps)]


def decode_map(rows: ScenarioColumns) -> MapFeatures:
    """Decode the map features of all rows, in their frame.

    Raises:
        LakeError: Lists of coordinates differ in length: the file is damaged.
    """
    return MapFeatures.read({}, StoredFeatures(rows, 0, 0))


def _rows(table: str, batch: pa.RecordBatch) -> ScenarioColumns:
    return ScenarioColumns(from_arrow(batch, LAYOUTS[table]), [0, batch.num_rows], Memory(0))


class _Described:
    """Fields of a scenario that are made of its metadata row when they are read.

    Args:
        row: Its metadata row.
    """

    def __init__(self, row: Mapping[str, Any]) -> None:
        self._row = row

    def __getitem__(self, field: str) -> Any:
        return _MAKERS[field](self._row)


def _timestamps(row: Mapping[str, Any]) -> Array:
    if row["timestamps"] is None:
        regular: Array = np.arange(row["num_timesteps"]) * row["dt"]
        return regular
    return np.array(row["timestamps"], dtype=np.float64)


_MAKERS: dict[str, Callable[[Mapping[str, Any]], Any]] = {
    "timestamps": _timestamps,
    "origin": lambda row: np.array([row["origin_x"], row["origin_y"], row["origin_z"]]),
    "source": lambda row: Source(
        scenario_id=row["source_scenario_id"],
        file=row["source_file"],
        licence=row["licence"],
        log=row["source_log"],
        city=row["city"],
        date=row["date"],
        crs=row["crs"],
    ),
    "objects_of_interest": lambda row: tuple(row["objects_of_interest"]),
    "tracks_to_predict": lambda row: tuple(
        zip(row["tracks_to_predict"], row["tracks_to_predict_difficulty"], strict=True)
    ),
    "extras": lambda row: from_json(row["extras"]),
}
