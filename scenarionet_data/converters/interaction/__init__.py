"""INTERACTION (https://interaction-dataset.com): traffic at crossings, roundabouts and merges, seen from drones.

RAW is the dataset's folder:

    maps/DR_USA_Intersection_MA.osm                                    Lanelet2 map of a place
    recorded_trackfiles/DR_USA_Intersection_MA/vehicle_tracks_000.csv
    recorded_trackfiles/DR_USA_Intersection_MA/pedestrian_tracks_000.csv    where there are any
"""

from __future__ import annotations

import os
import re
from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from functools import lru_cache
from pathlib import Path
from typing import Literal

import numpy as np

from scenarionet_data.arrays.dtypes import Bool, Float64
from scenarionet_data.building import MapBuilder, StateGrid, make_origin, make_tracks
from scenarionet_data.converters.base import Budgets, Converter, find_files
from scenarionet_data.converters.cities import CityMap
from scenarionet_data.converters.formats.lanelet2 import read_lanelet2
from scenarionet_data.converters.interaction.recording import FRAME_MS, TYPES, TrackRows, joined, read_rows
from scenarionet_data.errors import BadParameter, InvalidScenario, SourceNotFound
from scenarionet_data.ingest.defects import Defects
from scenarionet_data.ingest.options import Options
from scenarionet_data.ingest.shard import RawItem, Shard, fingerprint
from scenarionet_data.scenario.description import Lights, ScenarioDescription, Source, make_scenario_id
from scenarionet_data.scenario.vocabulary import ObjectType

DT = FRAME_MS / 1000.0
HISTORY = 10
"""``current_timestep``: after 1 s, as in the dataset's own challenge, or when the ego appears if that is later."""
_PEDESTRIANS, _VEHICLES = "pedestrian_tracks_", "vehicle_tracks_"
_ANCHOR = (0.0, 0.0)
"""Latitude and longitude of the frame of every map and recording."""

_MARGIN = 100.0
"""Margin of the map around all road users [m]: the whole map of most places."""


@dataclass(frozen=True)
class InteractionOptions(Options):
    """Windows, the ego, and the map."""

    window: float = field(default=20.0, metadata={"doc": "Length of a scenario [s]; recordings last about 5 minutes."})
    stride: float = field(default=0.0, metadata={"doc": "Time between the starts of two windows [s]; 0: the window."})
    ego: Literal["longest", "each"] = field(
        default="longest",
        metadata={"doc": "longest: the vehicle seen longest in a window; each: a scenario for each vehicle."},
    )
    every: int = field(default=1, metadata={"doc": "With ego=each: take every n-th vehicle of a window."})
    seen: float = field(default=4.0, metadata={"doc": "With ego=each: vehicles seen for at least this time [s]."})
    has_map: bool = field(default=True, metadata={"doc": "Whether scenarios get a map."})
    maps: str = field(default="", metadata={"doc": "Folder of the *.osm files; empty: below RAW.", "is_path": True})

    def __post_init__(self) -> None:
        if not (self.window >= DT and (self.stride == 0 or self.stride >= DT)):
            found = f"found {self.window} and {self.stride}"
            raise BadParameter(f"window, stride: expected {DT} s or more (or a stride of 0), {found}")
        if self.every < 1 or not self.seen >= 0:
            raise BadParameter(f"every, seen: expected 1 and 0 s or more, found {self.every} and {self.seen}")


@dataclass(frozen=True, eq=False)
class InteractionWindow:
    """Frames ``first`` to ``last - 1`` of a recording, seen from one vehicle: one scenario.

    Attributes:
        rows: TrackRows of the window, sorted by track and frame.
        ego: Number of the ego in ``rows.ids``; None if no vehicle is in the window.
        defects: TrackRows that were dropped; those of a recording are told with its first window.
    """

    rows: TrackRows
    first: int
    last: int
    ego: int | None
    defects: Defects


class Interaction(Converter[InteractionWindow]):
    """One shard per recording; the map of a place is shared."""

    name = "interaction"
    version = "1"
    release = "v1.1"
    licence = "INTERACTION dataset licence: non-commercial research, no redistribution"
    raw = "folder with recorded_trackfiles/<place>/vehicle_tracks_*.csv, and maps/<place>.osm in it or in maps"
    Options = InteractionOptions
    properties = ("location", "log")
    budgets = Budgets()

    def shards(self, raw: str, split: str, version: str, options: InteractionOptions) -> Iterator[Shard]:
        """List recordings."""
        files = find_files(raw, f"{_VEHICLES}*.csv", self.raw, split)
        root = Path(raw) if Path(raw).is_dir() else Path(raw).parent
        maps = _maps(raw, options)
        for path in files:
            place = path.resolve().parent.name
            beside = path.with_name(path.name.replace(_VEHICLES, _PEDESTRIANS))
            if options.has_map and place not in maps:
                raise SourceNotFound(f"{raw}: no map {place}.osm; name its folder by maps, or pass has_map=false")
            known = [maps[place]] if options.has_map else []
            mark = fingerprint([path, *([beside] if beside.is_file() else []), *known])
            log = f"{place}-{path.stem.removeprefix(_VEHICLES)}"
            name = re.sub(r"[^A-Za-z0-9._-]", "-", log)
            item = RawItem(path.relative_to(root).as_posix(), mark)
            resolved = replace(options, maps=str(known[0]) if known else "")
            yield Shard(self.name, version, split, name, str(root), (item,), resolved, {"location": place, "log": log})

    def files(self, shard: Shard) -> Iterator[list[str]]:
        """The tracks, and the map if it is below the same folder."""
        name, root = shard.items[0].name, Path(shard.root)
        file = shard.options_as(InteractionOptions).maps
        near = [Path(file).relative_to(root).as_posix()] if file and Path(file).is_relative_to(root) else []
        yield [*near, name, name.replace(_VEHICLES, _PEDESTRIANS)]

    def maps(self, raw: str, version: str, options: InteractionOptions) -> Iterator[Shard]:
        """List the maps of the places that are recorded."""
        places = {path.resolve().parent.name for path in find_files(raw, f"{_VEHICLES}*.csv", self.raw)}
        for place, path in _maps(raw, options).items():
            if place in places:
                item = RawItem(path.name, fingerprint([path]))
                yield Shard(self.name, version, "", place, str(path.parent), (item,), Options())

    def map_features(self, shard: Shard) -> MapBuilder:
        """Read the map of a place."""
        return _read_place(shard.paths[0], fingerprint(shard.paths)).features

    def records(self, shard: Shard) -> Iterator[InteractionWindow]:
        """Cut a recording every ``stride`` seconds into ``window`` seconds.

        What remains at the end joins the last window if it would end within its history: no row is left out.
        """
        options, defects = shard.options_as(InteractionOptions), Defects()
        path, file = shard.paths[0], shard.items[0].name
        rows = read_rows(path, file, defects)
        beside = path.with_name(path.name.replace(_VEHICLES, _PEDESTRIANS))
        if beside.is_file():
            rows = joined(rows, read_rows(beside, file.replace(_VEHICLES, _PEDESTRIANS), defects))
        size, step = round(options.window / DT), round((options.stride or options.window) / DT)
        start, end = int(rows.frame.min()), int(rows.frame.max()) + 1
        for first in range(start, end, step):
            last = first + size if first + size + HISTORY < end else end
            window = rows.take((rows.frame >= first) & (rows.frame < last))
            for ego in _egos(window, options) if len(window.line) else ():
                yield InteractionWindow(window, first, last, ego, defects)
                defects = Defects()
            if last == end:
                return

    def scenario(self, shard: Shard, record: InteractionWindow) -> ScenarioDescription:
        """Convert a window."""
        rows, log, place = record.rows, str(shard.properties["log"]), str(shard.properties["location"])
        moment, options = record.first * FRAME_MS, shard.options_as(InteractionOptions)
        times: Float64 = np.linspace(0.0, (record.last - record.first - 1) * DT, record.last - record.first)
        grid = StateGrid(rows.track, rows.frame - record.first, (len(rows.ids), len(times)))
        kinds = np.array([TYPES.get(word, ObjectType.OTHER) for word in rows.words])
        if record.ego is None:
            where = make_scenario_id(shard.dataset, shard.version, log, moment)
            raise InvalidScenario(where, "ego_id", "expected a vehicle in the window, found none")
        name = f"{log}-{rows.ids[record.ego]}" if options.ego == "each" else log
        seen = grid.valid[record.ego]
        position = grid.place(np.pad(rows.position, ((0, 0), (0, 1))))
        city = _read_place(Path(options.maps), fingerprint([Path(options.maps)])) if options.maps else None
        origin = make_origin(position[record.ego], seen, has_z=False)
        roads, crop = city.around(rows.position, _MARGIN, origin) if city else (None, None)
        return ScenarioDescription(
            id=make_scenario_id(shard.dataset, shard.version, name, moment),
            dataset=shard.dataset,
            version=shard.version,
            split=shard.split,
            timestamps=times,
            dt=DT,
            current_timestep=_current(seen),
            ego_id=rows.ids[record.ego],
            origin=origin,
            has_z=False,
            source=Source(log, shard.items[0].name, self.licence, log=log, city=place, crs="INTERACTION's local frame"),
            tracks=make_tracks(
                list(rows.ids),
                kinds,
                position,
                grid.place(rows.heading),
                grid.place(rows.velocity),
                grid.place(rows.size),
                grid.valid,
                origin=origin,
                source_type=list(rows.words),
                is_size_assumed=~rows.has_boxes,
                is_type_assumed=np.char.find(rows.words.astype(str), "/") >= 0,
            ),
            lights=Lights.empty(len(times)),
            map=roads,
            map_id=place if city else None,
            map_crop=crop,
            extras={"start_timestamp_ms": moment},
            defects=record.defects.found(),
        )


def _egos(rows: TrackRows, options: InteractionOptions) -> list[int | None]:
    """Numbers of the vehicles that are egos; None if there is none."""
    counts = np.bincount(rows.track, minlength=len(rows.ids))
    is_vehicle = np.array([TYPES.get(word) is ObjectType.VEHICLE for word in rows.words], np.bool_)
    if options.ego == "longest":
        return [int(np.where(is_vehicle, counts, 0).argmax()) if is_vehicle.any() else None]
    chosen = np.flatnonzero(is_vehicle & (counts * DT >= options.seen))
    return [int(row) for row in chosen[:: options.every]]


def _current(seen: Bool) -> int:
    """The timestep after the history, or the nearest one after it, or else before, at which the ego is seen."""
    steps = np.flatnonzero(seen)
    later = steps[steps >= min(HISTORY, len(seen) - 1)]
    return int(later[0] if len(later) else steps[-1])


def _maps(raw: str, options: InteractionOptions) -> dict[str, Path]:
    """Map of each place, by its name."""
    if not options.has_map:
        return {}
    found = []
    for place in filter(None, options.maps.split(os.pathsep)) if options.maps else [raw]:
        found += sorted(Path(place).rglob("*.osm")) if Path(place).is_dir() else [Path(place)]
    return {path.stem: path for path in found if path.suffix == ".osm"}


@lru_cache(maxsize=4)
def _read_place(path: Path, mark: str) -> CityMap:  # noqa: ARG001  # a changed file is read again
    return CityMap(read_lanelet2(path, _ANCHOR))
