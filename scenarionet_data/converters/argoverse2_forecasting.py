"""Argoverse 2 motion forecasting: one folder with ``scenario_<id>.parquet`` and its map is one scenario.

10 Hz, 11 s (5 s observed; the test split ends there), one row per observed state, city frame. The dataset
records no sizes, which come from a table by type, and no heights of objects: their boxes stand on the map's ground.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa

from scenarionet_data.building import make_origin, make_tracks
from scenarionet_data.converters.argoverse2_lines import Float64, ground_height
from scenarionet_data.converters.argoverse2_map import RoadMap, read_map
from scenarionet_data.converters.argoverse2_table import Grid, numbers, read_parquet, text
from scenarionet_data.converters.argoverse2_types import (
    EGO,
    EGO_SIZE,
    OBJECTS,
    SCORED,
    TRACK_CATEGORIES,
    UNKNOWN_OBJECT,
    Kind,
)
from scenarionet_data.converters.base import RawItem, Shard
from scenarionet_data.errors import CorruptSource, InvalidScenario
from scenarionet_data.scenario import Lights, ScenarioDescription, Source, Tracks, make_scenario_id


def read_scenario(shard: Shard, item: RawItem, licence: str) -> ScenarioDescription:
    """The scenario of one folder, given its Parquet file.

    Raises:
        InvalidScenario: A file of the folder is missing, damaged, or another scenario's. Not CorruptSource: the
            other folders of the shard are fine.
    """
    path = Path(shard.root) / item.name
    name = path.stem.removeprefix("scenario_")
    scenario_id = make_scenario_id(shard.dataset, shard.version, name)
    try:
        table = _Table(path)
        if table.word("scenario_id") != name:
            raise CorruptSource(f"{path}: holds scenario {table.word('scenario_id')}; give it its own name back")
        roads = read_map(path.with_name(f"log_map_archive_{name}.json"))
    except CorruptSource as error:
        raise InvalidScenario(scenario_id, "source", str(error)) from error
    if EGO not in table.grid.ids:
        raise InvalidScenario(scenario_id, "ego_id", f"wanted a track {EGO!r}, found {table.grid.ids[:3]} ...")
    return _describe(shard, scenario_id, table, roads, licence)


class _Table:
    """The columns of one scenario's Parquet file, checked, on their grid of tracks and timesteps."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self.rows = read_parquet(path)
        if not self.rows.num_rows:
            raise CorruptSource(f"{path}: wanted rows, found none; download it again")
        self.num_timesteps = int(self.number("num_timestamps"))
        timestep = numbers(self.rows, path, "timestep")
        self.grid = Grid(text(self.rows, path, "track_id"), timestep, self.num_timesteps, path)
        observed = timestep[numbers(self.rows, path, "observed").astype(bool)]
        self.current_timestep = int(observed.max(initial=0))
        self.motion = numbers(self.rows, path, "position_x", "position_y", "heading", "velocity_x", "velocity_y")
        types = text(self.rows, path, "object_type").take(pa.array(self.grid.first)).to_pylist()
        self.types: list[str] = types
        self.categories = numbers(self.rows, path, "object_category")[self.grid.first]

    def number(self, name: str) -> Any:
        """A value that all rows share."""
        return numbers(self.rows, self.path, name)[0]

    def word(self, name: str) -> str:
        """A word that all rows share."""
        words = text(self.rows, self.path, name)
        return str(words.dictionary[words.indices[0].as_py()])

    def optional(self, name: str) -> Any:
        """A value that all rows share; None without such a column (the owner's writer leaves some out)."""
        return self.rows.column(name)[0].as_py() if name in self.rows.column_names else None


def _describe(shard: Shard, scenario_id: str, table: _Table, roads: RoadMap, licence: str) -> ScenarioDescription:
    kinds = [_kind(track, word) for track, word in zip(table.grid.ids, table.types, strict=True)]
    position = _positions(table, kinds, roads)
    origin = make_origin(*_ego(table, position), has_z=True)
    focal = table.word("focal_track_id")
    scored = [track for track, n in zip(table.grid.ids, table.categories, strict=True) if n == SCORED]
    start, end = float(table.number("start_timestamp")), float(table.number("end_timestamp"))
    city = table.word("city")
    return ScenarioDescription(
        id=scenario_id,
        dataset=shard.dataset,
        version=shard.version,
        split=shard.split,
        timestamps=np.linspace(0.0, (end - start) * 1e-9, table.num_timesteps),
        dt=0.1,
        current_timestep=table.current_timestep,
        ego_id=EGO,
        origin=origin,
        has_z=True,
        source=Source(
            scenario_id=table.word("scenario_id"),
            file=table.path.relative_to(shard.root).as_posix(),
            licence=licence,
            # The slice of a drive that the scenario was cut from: the nearest thing to a log that is told.
            log=table.optional("slice_id"),
            city=city,
            # No date: the dataset's clock starts at the GPS epoch (1980-01-06), not at the day of recording.
            date=None,
            crs=f"argoverse2 city frame {city}",
        ),
        tracks=_tracks(table, kinds, position, origin),
        lights=Lights.empty(table.num_timesteps),
        map=roads.features(origin),
        objects_of_interest=(focal,),
        tracks_to_predict=tuple((track, 0) for track in dict.fromkeys([focal, *scored])),
        extras={
            "kind": "forecasting",
            "start_timestamp_ns": int(start),
            "slice_id": table.optional("slice_id"),
            "source_map_id": table.optional("map_id"),
            "num_completed_links": roads.num_completed_links,
            "track_z": "the map's ground",
        },
    )


def _kind(track: str, word: str) -> Kind:
    kind = OBJECTS.get(word, UNKNOWN_OBJECT)
    return kind._replace(size=EGO_SIZE) if track == EGO else kind


def _positions(table: _Table, kinds: list[Kind], roads: RoadMap) -> Float64:
    """(N, T, 3) box centres in the city frame: half a height above the map's ground."""
    places = table.motion[:, :2]
    height = table.grid.place(ground_height(roads.ground, places))
    height += np.array([kind.size[2] / 2.0 for kind in kinds])[:, None]
    return np.concatenate([table.grid.place(places), height[..., None]], axis=-1)


def _ego(table: _Table, position: Float64) -> tuple[Float64, Any]:
    row = table.grid.ids.index(EGO)
    return position[row], table.grid.valid[row]


def _tracks(table: _Table, kinds: list[Kind], position: Float64, origin: Float64) -> Tracks:
    motion = table.grid.place(table.motion)
    return make_tracks(
        table.grid.ids,
        [kind.type for kind in kinds],
        position,
        motion[..., 2],
        motion[..., 3:5],
        np.array([kind.size for kind in kinds]),
        table.grid.valid,
        origin=origin,
        source_type=table.types,
        is_size_assumed=True,
        is_type_assumed=[kind.is_assumed for kind in kinds],
        extras=[{"object_category": _category(int(number))} for number in table.categories],
    )


def _category(number: int) -> str:
    return TRACK_CATEGORIES[number] if 0 <= number < len(TRACK_CATEGORIES) else str(number)
