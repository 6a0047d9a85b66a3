"""Argoverse 2 motion forecasting: one scenario per folder, with ``scenario_<id>.parquet`` and its map.

10 Hz, 11 s (5 s of history; the test split ends there), one row per observed state, city frame. The dataset has no
sizes, which are assumed by type, and no heights of objects, which are placed on the map's ground.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa

from scenarionet_data.arrays.dtypes import Float64
from scenarionet_data.building import make_origin, make_tracks
from scenarionet_data.converters.argoverse2.map_features import Argoverse2Map, read_map
from scenarionet_data.converters.argoverse2.polylines import ground_height
from scenarionet_data.converters.argoverse2.table import TrackGrid, column, numbers, read_parquet, text
from scenarionet_data.converters.argoverse2.types import (
    EGO,
    EGO_SIZE,
    OBJECTS,
    TRACK_CATEGORIES,
    UNKNOWN_OBJECT,
    TypeMapping,
)
from scenarionet_data.errors import CorruptSource, InvalidScenario
from scenarionet_data.ingest.shard import RawItem, Shard
from scenarionet_data.scenario.description import (
    Lights,
    ScenarioDescription,
    Source,
    Tracks,
    make_scenario_id,
)


def read_scenario(shard: Shard, item: RawItem, licence: str) -> ScenarioDescription:
    """Convert the folder of a Parquet file to a scenario.

    Raises:
        InvalidScenario: A file of the folder is missing, damaged or of another scenario. Not CorruptSource: the
            other folders of the shard are unaffected.
    """
    path = Path(shard.root) / item.name
    name = path.stem.removeprefix("scenario_")
    scenario_id = make_scenario_id(shard.dataset, shard.version, name)
    try:
        table = _Table(path)
        roads = read_map(path.with_name(f"log_map_archive_{name}.json"))
    except CorruptSource as error:
        raise InvalidScenario(scenario_id, "source", str(error)) from error
    if EGO not in table.grid.ids:
        raise InvalidScenario(scenario_id, "ego_id", f"expected a track {EGO!r}, found {table.grid.ids[:3]} ...")
    source = Source(
        scenario_id=name,
        file=item.name,
        licence=licence,
        log=table.slice,
        city=table.city,
        date=None,  # the dataset's clock starts at the GPS epoch, 1980-01-06
        crs=f"argoverse2 city frame {table.city}",
    )
    return _describe(shard, scenario_id, source, table, roads)


class _Table:
    """One scenario's Parquet file, validated: constant columns, and rows on a grid of tracks and timesteps.

    Attributes:
        city, focal: City and id of the focal track.
        slice, map: The slice of a drive that the scenario was cut from (used as its log), and the source's number of
            the map; None if missing.
        start: Time of the first timestep [ns].
        timestamps: (T,) [s] from the start.
        current_timestep: The last observed one.
        grid: N tracks by T timesteps.
        motion: (R, 5) x, y [m], heading [rad], velocity x, y [m/s] of each row.
        types, categories: (N,) values of the source.
    """

    def __init__(self, path: Path) -> None:
        rows = read_parquet(path)
        shared = _Shared(rows, path)
        if shared.word("scenario_id") != path.stem.removeprefix("scenario_"):
            raise CorruptSource(f"{path}: contains scenario {shared.word('scenario_id')}; restore its original name")
        self.city, self.focal = shared.word("city"), shared.word("focal_track_id")
        self.slice, self.map = shared.optional("slice_id"), shared.optional("map_id")
        self.start, end = shared.number("start_timestamp"), shared.number("end_timestamp")
        count = int(shared.number("num_timestamps"))
        self.timestamps = np.linspace(0.0, (end - self.start) * 1e-9, count)
        timestep = numbers(rows, path, "timestep")
        observed = numbers(rows, path, "observed").astype(bool)
        self.current_timestep = int(timestep[observed].max(initial=0))
        self.grid = TrackGrid(text(rows, path, "track_id"), timestep, count, path)
        self.motion = numbers(rows, path, "position_x", "position_y", "heading", "velocity_x", "velocity_y")
        types: list[str] = text(rows, path, "object_type").take(self.grid.first).to_pylist()
        self.types = types
        categories = numbers(rows, path, "object_category")[self.grid.first]
        self.categories = [TRACK_CATEGORIES.get(int(number), str(number)) for number in categories]


class _Shared:
    """Read columns with a single value in all rows of a scenario."""

    def __init__(self, rows: pa.Table, path: Path) -> None:
        if not rows.num_rows:
            raise CorruptSource(f"{path}: expected rows, found none; download it again")
        self._rows, self._path = rows, path

    def number(self, name: str) -> float:
        return float(numbers(self._rows, self._path, name)[0])

    def word(self, name: str) -> str:
        return str(column(self._rows, self._path, name)[0])

    def optional(self, name: str) -> Any:
        """Return None for a missing column: some files lack optional ones."""
        return self._rows.column(name)[0].as_py() if name in self._rows.column_names else None


def _describe(
    shard: Shard, scenario_id: str, source: Source, table: _Table, roads: Argoverse2Map
) -> ScenarioDescription:
    kinds = [_kind(track, word) for track, word in zip(table.grid.ids, table.types, strict=True)]
    position = _positions(table, kinds, roads)
    ego = table.grid.ids.index(EGO)
    origin = make_origin(position[ego], table.grid.valid[ego], has_z=True)
    scored = [track for track, word in zip(table.grid.ids, table.categories, strict=True) if word == "SCORED"]
    return ScenarioDescription(
        id=scenario_id,
        dataset=shard.dataset,
        version=shard.version,
        split=shard.split,
        timestamps=table.timestamps,
        dt=0.1,
        current_timestep=table.current_timestep,
        ego_id=EGO,
        origin=origin,
        has_z=True,
        source=source,
        tracks=_tracks(table, kinds, position, origin),
        lights=Lights.empty(len(table.timestamps)),
        map=roads.features(origin),
        objects_of_interest=(table.focal,),
        tracks_to_predict=tuple((track, 0) for track in dict.fromkeys([table.focal, *scored])),
        extras={
            "kind": "forecasting",
            "start_timestamp_ns": int(table.start),
            "source_map_id": table.map,
            "num_completed_links": roads.num_completed_links,
            "track_z": "the map's ground",
        },
    )


def _kind(track: str, word: str) -> TypeMapping:
    kind = OBJECTS.get(word, UNKNOWN_OBJECT)
    return kind._replace(size=EGO_SIZE) if track == EGO else kind


def _positions(table: _Table, kinds: list[TypeMapping], roads: Argoverse2Map) -> Float64:
    """(N, T, 3) box centres in the city frame, half a height above the map's ground."""
    places = table.motion[:, :2]
    height = table.grid.place(ground_height(roads.ground, places))
    height += np.array([kind.size[2] / 2.0 for kind in kinds])[:, None]
    return np.concatenate([table.grid.place(places), height[..., None]], axis=-1)


def _tracks(table: _Table, kinds: list[TypeMapping], position: Float64, origin: Float64) -> Tracks:
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
        extras=[{"object_category": word} for word in table.categories],
    )
