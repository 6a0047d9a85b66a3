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
from dataclasses import dataclass, replace
from pathlib import Path

from scenarionet_data.building import MapBuilder
from scenarionet_data.converters.base import Budgets, Converter, find_files
from scenarionet_data.converters.cities import CityMap
from scenarionet_data.converters.formats.lanelet2 import read_lanelet2
from scenarionet_data.converters.table.columns import TYPES, TableColumn, TableColumns
from scenarionet_data.converters.table.rows import joined, read_rows
from scenarionet_data.converters.table.windows import TrackWindow, WindowOptions, cut, describe
from scenarionet_data.errors import SourceNotFound
from scenarionet_data.ingest.defects import Defects
from scenarionet_data.ingest.listing import cached_by_file
from scenarionet_data.ingest.options import Options, option
from scenarionet_data.ingest.shard import RawItem, Shard, fingerprint
from scenarionet_data.scenario.description import ScenarioDescription, Source
from scenarionet_data.scenario.vocabulary import ObjectType

DT = 0.1
"""Time between frames [s]."""
PERSON = (0.7, 0.7)
"""Length and width [m] where none is recorded: of pedestrians and cyclists."""
HEIGHT = 1.6
"""Height of every road user [m]; none is recorded."""
_UNSURE = {
    "truck/bus": ObjectType.VEHICLE,
    "motorcycle/bicycle": ObjectType.CYCLIST,
    "pedestrian/bicycle": ObjectType.PEDESTRIAN,
}
COLUMNS = TableColumns(
    columns={
        "track": TableColumn("track_id"),
        "type": TableColumn("agent_type"),
        "time": TableColumn("timestamp_ms", "ms"),
        **{name: TableColumn(name) for name in ("x", "y", "vx", "vy", "length", "width")},
        "heading": TableColumn("psi_rad"),
    },
    types={**TYPES, **_UNSURE},
    unsure=frozenset(_UNSURE),
    sizes=dict.fromkeys(ObjectType, (*PERSON, HEIGHT)),
    step=DT,
    origin=(0.0, 0.0),
)
"""Files of pedestrians and cyclists lack the heading, length and width. Metres are those of the place's map."""
_PEDESTRIANS, _VEHICLES = "pedestrian_tracks_", "vehicle_tracks_"


@dataclass(frozen=True)
class InteractionOptions(WindowOptions):
    """Windows, the ego, and the map."""

    has_map: bool = option(True, "Whether scenarios get a map.")
    maps: str = option("", "Folder of the *.osm files; empty: below RAW.", is_path=True)


class Interaction(Converter[TrackWindow]):
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
        return _read_place(shard.paths[0]).features

    def records(self, shard: Shard) -> Iterator[TrackWindow]:
        """Cut a recording into windows."""
        defects = Defects()
        path, file = shard.paths[0], shard.items[0].name
        rows, clock = read_rows(path, file, COLUMNS, defects)
        beside = path.with_name(path.name.replace(_VEHICLES, _PEDESTRIANS))
        if beside.is_file():
            rows = joined(rows, read_rows(beside, file.replace(_VEHICLES, _PEDESTRIANS), COLUMNS, defects)[0])
        yield from cut(rows, clock, shard.options_as(InteractionOptions), defects)

    def scenario(self, shard: Shard, record: TrackWindow) -> ScenarioDescription:
        """Convert a window."""
        log, place = str(shard.properties["log"]), str(shard.properties["location"])
        file = shard.options_as(InteractionOptions).maps
        city = _read_place(Path(file)) if file else None
        source = Source(log, shard.items[0].name, self.licence, log=log, city=place, crs="INTERACTION's local frame")
        return describe(shard, record, source, city, place)


def _maps(raw: str, options: InteractionOptions) -> dict[str, Path]:
    """Map of each place, by its name."""
    if not options.has_map:
        return {}
    found = []
    for place in filter(None, options.maps.split(os.pathsep)) if options.maps else [raw]:
        found += sorted(Path(place).rglob("*.osm")) if Path(place).is_dir() else [Path(place)]
    return {path.stem: path for path in found if path.suffix == ".osm"}


@cached_by_file(4)
def _read_place(path: Path) -> CityMap:
    return CityMap(read_lanelet2(path, COLUMNS.origin))
