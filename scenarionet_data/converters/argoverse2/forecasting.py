"""Argoverse 2 motion forecasting: one scenario per folder, with ``scenario_<id>.parquet`` and its map.

10 Hz, 11 s (5 s of history; the test split ends there), one row per observed state, city frame. The dataset has no
sizes, which are assumed by type, and no heights of objects, which are placed on the map's ground.
"""

from __future__ import annotations

from pathlib import Path, PurePosixPath
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc

from scenarionet_data.arrays.dtypes import Bool, Float64, Int64
from scenarionet_data.building import bridge_gaps, make_origin, make_tracks
from scenarionet_data.building.plausible import find_bad_rows, find_repeated_rows
from scenarionet_data.converters.argoverse2.map_features import Argoverse2Map, read_map
from scenarionet_data.converters.argoverse2.polylines import ground_height
from scenarionet_data.converters.argoverse2.table import (
    TrackGrid,
    first_number,
    first_word,
    integers,
    numbers,
    read_parquet,
    text,
)
from scenarionet_data.converters.argoverse2.types import (
    EGO,
    EGO_SIZE,
    OBJECTS,
    TRACK_CATEGORIES,
    UNKNOWN_OBJECT,
    TypeMapping,
)
from scenarionet_data.errors import CorruptSource, InvalidScenario
from scenarionet_data.ingest.defects import Defects
from scenarionet_data.ingest.shard import RawItem, Shard
from scenarionet_data.scenario.description import (
    Lights,
    ScenarioDescription,
    Source,
    Tracks,
    make_scenario_id,
)

_FIELDS = {"position": "position_x", "heading": "heading", "velocity": "velocity_x"}
_MAX_TIMESTEPS = 10_000
"""Largest accepted number of timesteps; the dataset has 110."""


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
        table = _Table(path, item.name)
        map_name = f"log_map_archive_{name}.json"
        roads = read_map(path.with_name(map_name), (PurePosixPath(item.name).parent / map_name).as_posix())
    except CorruptSource as error:
        raise InvalidScenario(scenario_id, "source", str(error)) from error
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
    """One scenario's Parquet file: constant columns, and the usable rows on a grid of tracks and timesteps.

    Attributes:
        city, focal: City and id of the focal track.
        slice, map: The slice of a drive that the scenario was cut from (used as its log), and the source's number of
            the map; None if missing.
        start: Time of the first timestep [ns].
        timestamps: (T,) [s] from the start.
        current_timestep: The last observed one.
        grid: N tracks by T timesteps.
        motion: (N, T, 5) x, y [m], heading [rad], velocity x, y [m/s].
        is_interpolated: (N, T) states of the ego whose row cannot be used.
        types, categories: (N,) values of the source.
        defects: The other rows, and those with assumed values.
    """

    def __init__(self, path: Path, file: str) -> None:
        rows = read_parquet(path)
        self.defects = Defects()
        name = first_word(rows, path, "scenario_id")
        if name != path.stem.removeprefix("scenario_"):
            raise CorruptSource(f"{path}: contains scenario {name}; restore its original name")
        self.city, self.focal = first_word(rows, path, "city"), first_word(rows, path, "focal_track_id")
        self.slice, self.map = _optional(rows, "slice_id", str), _optional(rows, "map_id", int)
        count = first_number(rows, path, "num_timestamps", 1, _MAX_TIMESTEPS)
        self.start = first_number(rows, path, "start_timestamp", -(2.0**62), 2.0**62)
        end = first_number(rows, path, "end_timestamp", -(2.0**62), 2.0**62)
        self.timestamps = np.linspace(0.0, (end - self.start) * 1e-9, count)
        timestep, has_time = integers(rows, path, "timestep")
        tracks, has_track = text(rows, path, "track_id")
        motion = numbers(rows, path, "position_x", "position_y", "heading", "velocity_x", "velocity_y")
        observed, _ = integers(rows, path, "observed")
        kept = self._usable(
            file, path, timestep, has_time & (timestep >= 0) & (timestep < count), tracks, has_track, motion
        )
        self.current_timestep = int(timestep[kept][observed[kept] != 0].max(initial=0))
        self.grid = TrackGrid(tracks.take(kept), timestep[kept], count)
        motion = self.grid.place(motion[kept])
        ego, is_interpolated = self.grid.ids.index(EGO), np.zeros_like(self.grid.valid)
        bridged, filled = bridge_gaps(self.timestamps, self.grid.valid[ego], motion[ego], angle=2)
        reason = "expected usable rows of the ego at every timestep, found none; interpolated"
        steps = [f"timestep {step}" for step in np.flatnonzero(filled)]
        self.defects.assume("tracks", file, steps, "position_x", reason)
        motion[ego, filled], self.grid.valid[ego, filled], is_interpolated[ego] = bridged[filled], True, filled
        self.motion, self.is_interpolated = motion, is_interpolated
        first = kept[self.grid.first]
        types, _ = text(rows, path, "object_type")
        self.types: list[str] = types.take(first).to_pylist()
        unknown = [track for track, word in zip(self.grid.ids, self.types, strict=True) if word not in OBJECTS]
        wanted = "expected an object type of the dataset, found another or none"
        self.defects.assume("tracks", file, [f"track {track}" for track in unknown], "object_type", wanted)
        if self.focal not in self.grid.ids:
            wanted = "expected rows of the focal track, found none: it is not to be predicted"
            self.defects.assume("tracks", file, [f"track {self.focal}"], "focal_track_id", wanted)
        categories, _ = integers(rows, path, "object_category")
        self.categories = [TRACK_CATEGORIES.get(number, str(number)) for number in categories[first].tolist()]

    def _usable(
        self, file: str, path: Path, timestep: Int64, has_time: Bool, tracks: Any, has_track: Bool, motion: Float64
    ) -> Int64:
        """Numbers of the rows that can be used; the others are added to the defects.

        Raises:
            CorruptSource: No row of the ego can be used.
        """
        kept = np.ones(len(timestep), np.bool_)

        def drop(mask: Bool, field: str, reason: str) -> None:
            nonlocal kept
            self.defects.drop("tracks", file, np.flatnonzero(mask & kept).tolist(), field, reason)
            kept &= ~mask

        drop(~has_time, "timestep", "expected a timestep of the scenario, found another")
        drop(~has_track, "track_id", "expected the id of a track, found null")
        is_ego = np.asarray(pc.equal(tracks, EGO).to_numpy(zero_copy_only=False), np.bool_)
        ego = is_ego & kept & np.isfinite(motion).all(axis=1)
        middle = np.median(motion[ego, :2], axis=0) if ego.any() else np.zeros(2)
        position = np.pad(motion[:, :2], ((0, 0), (0, 1)))
        for bad in find_bad_rows(position, motion[:, 2], motion[:, 3:5], None, middle):
            drop(bad.mask, _FIELDS[bad.field], bad.reason)
        repeated = find_repeated_rows(tracks.indices.to_numpy(), timestep, kept)
        if repeated:
            drop(repeated.mask, "timestep", repeated.reason)
        if not (is_ego & kept).any():
            raise CorruptSource(f"{path}: expected usable rows of the track {EGO!r}, found none; download it again")
        return np.flatnonzero(kept)


def _optional(rows: pa.Table, name: str, kind: type) -> Any:
    """The value of a column that some files lack; None if it is missing, null or of another type."""
    found = rows.column(name)[0].as_py() if rows.column_names.count(name) == 1 and rows.num_rows else None
    return found if isinstance(found, kind) else None


def _describe(
    shard: Shard, scenario_id: str, source: Source, table: _Table, roads: Argoverse2Map
) -> ScenarioDescription:
    kinds = [_kind(track, word) for track, word in zip(table.grid.ids, table.types, strict=True)]
    position, valid = np.pad(table.motion[..., :2], ((0, 0), (0, 0), (0, 1))), table.grid.valid
    position[valid, 2] = ground_height(roads.ground, position[valid, :2])
    position[..., 2] += np.array([kind.size[2] / 2.0 for kind in kinds])[:, None]
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
        objects_of_interest=tuple(scored),
        tracks_to_predict=((table.focal, 0),) if table.focal in table.grid.ids else (),
        extras={
            "kind": "forecasting",
            "start_timestamp_ns": int(table.start),
            "source_map_id": table.map,
            "num_completed_links": roads.num_completed_links,
            "track_z": "the map's ground",
        },
        defects=(*table.defects.found(), *roads.defects),
    )


def _kind(track: str, word: str) -> TypeMapping:
    kind = OBJECTS.get(word, UNKNOWN_OBJECT)
    return kind._replace(size=EGO_SIZE) if track == EGO else kind


def _tracks(table: _Table, kinds: list[TypeMapping], position: Float64, origin: Float64) -> Tracks:
    motion = table.motion
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
        is_interpolated=table.is_interpolated,
        extras=[{"object_category": word} for word in table.categories],
    )
