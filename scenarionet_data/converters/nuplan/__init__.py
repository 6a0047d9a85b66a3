"""nuPlan (https://www.nuscenes.org/nuplan): SQLite logs and GeoPackage maps, without nuplan-devkit.

RAW is a folder with ``.db`` logs at any depth. The maps are below RAW too, or in ``$NUPLAN_MAPS_ROOT``:

    nuplan-maps-v1.0.json                        the newest version of each map
    us-nv-las-vegas-strip/9.15.1915/map.gpkg     <location>/<version>/map.gpkg

A scenario is a scene of a log or a window around a scenario tag, with 10 or 20 timesteps per second, in the city's
UTM zone. Heights are dropped, as the maps have none.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from types import MappingProxyType
from typing import ClassVar, get_args

import numpy as np

from scenarionet_data.building import MapBuilder
from scenarionet_data.converters.base import Budgets, Converter, counted, unused_files
from scenarionet_data.converters.nuplan.content import read_content
from scenarionet_data.converters.nuplan.files import (
    MANIFESTS,
    SENSORS,
    find_atlas,
    find_logs,
    logs_of,
    place_of,
    properties_of,
)
from scenarionet_data.converters.nuplan.log import opened, read_log, scenes, tag_windows
from scenarionet_data.converters.nuplan.map_features import read_city
from scenarionet_data.converters.nuplan.scenario import Cut, describe
from scenarionet_data.errors import BadParameter, CorruptSource
from scenarionet_data.ingest.options import Frames, Options, option
from scenarionet_data.ingest.passed_over import PassedOver
from scenarionet_data.ingest.shard import RawItem, Shard, fingerprint
from scenarionet_data.scenario.description import ScenarioDescription


@dataclass(frozen=True)
class NuPlanOptions(Options):
    """Windows of scenarios, and location and extent of their maps."""

    by: str = option("scene", "scene: the 20 s scenes of the dataset; tag: a window around each scenario tag.")
    tags: str = option("", "With by=tag: comma-separated types of tags; empty: all. --where tag=TYPE selects logs.")
    past: float = option(2.0, "History [s]: before a tag, or from the start of a scene.")
    future: float = option(8.0, "With by=tag: future after the tag [s].")
    frames: Frames = option(
        "resampled", "resampled: every second recorded sweep, 10 per second; recorded: every sweep, 20."
    )
    radius: float = option(100.0, "Margin of the map around the bounding box of the ego's path [m].")
    maps: str = option("", "Folder of nuplan-maps-v1.0.json; empty: below RAW, or $NUPLAN_MAPS_ROOT.", is_path=True)

    removed: ClassVar[Mapping[str, str]] = MappingProxyType({"rate": "set frames to 'recorded' for 20 per second"})

    def __post_init__(self) -> None:
        if self.by not in ("scene", "tag"):
            raise BadParameter(f"by: expected scene or tag, found {self.by!r}")
        if self.tags and self.by != "tag":
            raise BadParameter("tags: only used with by=tag; with by=scene all scenes are converted")
        if self.frames not in get_args(Frames):
            raise BadParameter(f"frames: expected recorded or resampled, found {self.frames!r}")
        if not (0.0 <= self.past < 1e6 and 0.0 <= self.future < 1e6 and 0.0 <= self.radius < 1e6):
            found = f"{self.past}, {self.future} and {self.radius}"
            raise BadParameter(f"past, future, radius: expected values of 0 or more, found {found}")

    @property
    def stride(self) -> int:
        """Number of sweeps per timestep."""
        return 1 if self.frames == "recorded" else 2

    @property
    def wanted(self) -> frozenset[str]:
        """Types in ``tags``."""
        return frozenset(part.strip() for part in self.tags.split(",") if part.strip())


class NuPlan(Converter[Cut]):
    """One shard per log; the maps of the cities are shared."""

    name = "nuplan"
    version = "2"
    release = "v1.1"
    licence = "CC BY-NC-SA 4.0"
    raw = "folder of nuPlan logs (*.db), with the maps in it or in $NUPLAN_MAPS_ROOT"
    Options = NuPlanOptions
    properties = ("location", "log", "date", "tag")
    listed = (MANIFESTS,)
    ignored = SENSORS
    # Measured in two scenarios: 0.15, 2.7 and 0.13; and 0.8, 8.3 and 0.08 in one of 0.2 s at 20 Hz.
    budgets = Budgets(velocity_median=1.0, velocity_p99=10.0, heading_p99=0.5)

    def shards(self, raw: str, split: str, version: str, options: NuPlanOptions) -> Iterator[Shard]:
        """List one shard per log, city by city."""
        atlas = find_atlas(Path(raw), options.maps)
        resolved = replace(options, maps=str(atlas.root))
        places = {log: place_of(log) for log in logs_of(split, Path(raw))}
        for log in sorted(places, key=lambda log: (places[log].map_name, log.stem)):
            item = RawItem(log.relative_to(raw).as_posix(), fingerprint([log, atlas.manifest]))
            name = re.sub(r"[^A-Za-z0-9._-]", "-", log.stem)
            yield Shard(self.name, version, split, name, raw, (item,), resolved, properties_of(log, places[log]))

    def passed_over(
        self, raw: str, split: str, options: NuPlanOptions, shards: Sequence[Shard]
    ) -> Iterator[PassedOver]:
        """List maps of cities without logs, and the files that are not read."""
        atlas = find_atlas(Path(raw), options.maps)
        known = {atlas.root / name / version / "map.gpkg" for name, version in atlas.versions.items()}
        used = {path for _, path in (atlas.find(place_of(path)) or ("", path) for s in shards for path in s.paths)}
        idle = {path for path in known if path.is_file() and path not in used}
        yield from counted("maps", len(idle), "no log of the split was recorded there")
        logs = {path for shard in shards for path in shard.paths}
        yield from unused_files(Path(raw), {*logs, *known, atlas.manifest}.__contains__, split, self.ignored)

    def files(self, shard: Shard) -> Iterator[list[str]]:
        """The log and, if below the same root, the map of its city."""
        (item,), (path,), root, maps = (
            shard.items,
            shard.paths,
            Path(shard.root),
            Path(shard.options_as(NuPlanOptions).maps),
        )
        if not maps.is_relative_to(root):
            yield [item.name]
            return
        yield [item.name, (maps / MANIFESTS).relative_to(root).as_posix()]
        found = find_atlas(path.parent, str(maps)).candidates(place_of(path)).values()
        yield [place.relative_to(root).as_posix() for place in found]

    def records(self, shard: Shard) -> Iterator[Cut]:
        """Yield the windows of a log."""
        options = shard.options_as(NuPlanOptions)
        (path,) = shard.paths
        with opened(path) as database:
            log = read_log(database, path)
        atlas = find_atlas(path.parent, options.maps)
        map_id, place = atlas.map_of(log.place, path)
        city = read_city(place, atlas.root)
        if log.epsg is not None and city.projection.lower() != f"epsg:{log.epsg}":
            raise CorruptSource(f"{path}: recorded in epsg:{log.epsg}, but its map {place} is in {city.projection}")
        windows = list(
            scenes(log, options.stride, options.past)
            if options.by == "scene"
            else tag_windows(log, options.stride, options.past, options.future, options.wanted)
        )
        is_wanted = np.zeros(len(log.tokens), np.bool_)
        for window in windows:
            is_wanted[window.sweeps] = True
        content = read_content(path, log, is_wanted)
        for window in windows:
            yield Cut(log, content, window, city, map_id, options.radius, options.stride)

    def scenario(self, shard: Shard, record: Cut) -> ScenarioDescription:
        """Convert a window."""
        return describe(shard, record, self.licence)

    def maps(self, raw: str, version: str, options: NuPlanOptions) -> Iterator[Shard]:
        """List the maps of the logs' cities; a log without map fails alone."""
        atlas = find_atlas(Path(raw), options.maps)
        for map_id, path in atlas.maps_of(find_logs(Path(raw))).items():
            item = RawItem(path.relative_to(atlas.root).as_posix(), fingerprint([path]))
            yield Shard(self.name, version, "", map_id, str(atlas.root), (item,), Options())

    def map_features(self, shard: Shard) -> MapBuilder:
        """Read a city's map."""
        return read_city(shard.paths[0], Path(shard.root)).features
