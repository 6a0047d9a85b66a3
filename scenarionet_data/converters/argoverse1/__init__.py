"""Argoverse 1 motion forecasting (https://www.argoverse.org/av1.html): CSV files and vector maps, without its API.

RAW is the folder of one split or of the whole dataset, with the maps of the HD map download anywhere below:

    train/data/1.csv                                 5 s of a drive; val/data and test_obs/data (2 s) likewise
    map_files/pruned_argoverse_MIA_10316_vector_map.xml
    map_files/pruned_argoverse_PIT_10314_vector_map.xml
"""

from __future__ import annotations

import os
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

from scenarionet_data.building import MapBuilder
from scenarionet_data.converters.argoverse1.map_features import (
    Argoverse1City,
    find_maps,
    map_id,
    maps_by_city,
    read_city,
)
from scenarionet_data.converters.argoverse1.recording import read_recording
from scenarionet_data.converters.argoverse1.scenario import Argoverse1Options, describe
from scenarionet_data.converters.argoverse1.table import city_of, is_recording
from scenarionet_data.converters.base import Budgets, Converter, find_files
from scenarionet_data.errors import CorruptSource, InvalidScenario, SourceNotFound
from scenarionet_data.ingest.defects import Defects
from scenarionet_data.ingest.input_properties import LazyProperties, is_local
from scenarionet_data.ingest.options import Options
from scenarionet_data.ingest.shard import RawItem, Shard, bucket, fingerprint
from scenarionet_data.scenario.description import ScenarioDescription, make_scenario_id

USUAL_NOISE, RARE_NOISE = 0.21, 1.33
"""Errors of positions that 75 % and 99.5 % of the rows do not exceed [m], measured: see ``docs/guides/checks.md``."""
VELOCITY_NOISE = 0.12
"""Standard deviation of fitted velocities [m/s]: that of a position (0.21 / 1.665 m) over the root of the summed
squared times of eleven frames (1.05 s)."""
_FINGERPRINT_SAMPLE = 4096
"""Bytes hashed at each end of a file: there are 300,000 files of 90 kB to list."""
_PEEKED = 16
"""Number of files opened to recognise this dataset among other folders of CSV files."""


class Argoverse1(Converter[RawItem]):
    """One scenario per file, in buckets; the maps of the two cities are shared."""

    name = "argoverse1"
    version = "2"
    release = "v1.1"
    licence = "CC BY-NC-SA 4.0"
    raw = "folder of forecasting files (*.csv), with the maps (*_vector_map.xml) in it or in the option maps"
    Options = Argoverse1Options
    properties = ("location",)
    budgets = Budgets.from_noise(
        USUAL_NOISE, RARE_NOISE, velocity=VELOCITY_NOISE, outliers=0.1
    )  # noise differs between recordings

    def maps(self, raw: str, version: str, options: Argoverse1Options) -> Iterator[Shard]:
        """List the maps of the cities."""
        for path in _maps_for(raw, options):
            item = RawItem(path.name, fingerprint([path]))
            yield Shard(self.name, version, "", map_id(path), str(path.parent), (item,), Options())

    def map_features(self, shard: Shard) -> MapBuilder:
        """Read the map of a city."""
        return read_city(shard.paths[0]).features

    def shards(self, raw: str, split: str, version: str, options: Argoverse1Options) -> Iterator[Shard]:
        """List buckets of files."""
        files = find_files(raw, "*.csv", f"Argoverse 1 recordings of split {split}", split)
        if not any(is_recording(path) or not is_local(path) for path in files[:_PEEKED]):
            raise SourceNotFound(
                f"{files[0]} and others are not Argoverse 1 recordings; give a folder that contains some"
            )
        root = Path(raw) if Path(raw).is_dir() else Path(raw).parent
        maps = _maps_for(raw, options)
        known = fingerprint(maps) if maps else ""  # scenarios change if a map is added later
        resolved = replace(options, maps=os.pathsep.join(map(str, maps)))  # saves workers the search
        items = []
        for path in files:
            mark, properties = fingerprint([path], _FINGERPRINT_SAMPLE), LazyProperties({}, ("location",), _fact, path)
            items.append(RawItem(path.relative_to(root).as_posix(), mark + known, properties))
        for name, members in bucket(items).items():
            yield Shard(self.name, version, split, name, str(root), members, resolved)

    def files(self, shard: Shard) -> Iterator[list[str]]:
        """Files of a bucket and the maps below the same root."""
        root, maps = Path(shard.root), filter(None, shard.options_as(Argoverse1Options).maps.split(os.pathsep))
        shared = [Path(path).relative_to(root).as_posix() for path in maps if Path(path).is_relative_to(root)]
        yield [*shared, *(item.name for item in shard.items)]

    def records(self, shard: Shard) -> Iterator[RawItem]:
        """Yield the files of a bucket."""
        yield from shard.items

    def scenario(self, shard: Shard, record: RawItem) -> ScenarioDescription:
        """Read one file."""
        options = shard.options_as(Argoverse1Options)
        path = Path(shard.root) / record.name
        # Files are numbered from 1 in every split.
        scenario_id = make_scenario_id(shard.dataset, shard.version, f"{shard.split}-{path.stem}")
        defects = Defects()
        try:
            recording = read_recording(path, record.name, defects)
            city = _city(recording.city, path, options) if options.has_map else None
        except CorruptSource as error:  # of this file or its map: continue with the other files
            raise InvalidScenario(scenario_id, "source", str(error)) from error
        return describe(shard, scenario_id, record.name, recording, city, options, self.licence, defects)


def _fact(path: Path, _key: str) -> str | tuple[str, ...]:
    return city_of(path) or ()


def _maps_for(raw: str, options: Argoverse1Options) -> list[Path]:
    """Find the map files; none if scenarios are converted without maps.

    Raises:
        SourceNotFound: No map files, or a folder in place of one.
    """
    if not options.has_map:
        return []
    places = options.maps or raw
    found = list(find_maps(places).values())
    if not found:
        raise SourceNotFound(
            f"{places}: no pruned_argoverse_*_vector_map.xml in it; download the HD maps and set the option maps "
            "to their folder, or has_map to false"
        )
    folders = [path for path in found if path.is_dir()]
    if folders:
        raise SourceNotFound(f"{folders[0]}: expected a map, found a folder; download the HD maps again")
    return found


def _city(name: str, path: Path, options: Argoverse1Options) -> Argoverse1City:
    maps = maps_by_city(options.maps)
    if name not in maps:
        raise CorruptSource(
            f"{path}: recorded in {name!r}, and there is no pruned_argoverse_{name}_*_vector_map.xml (of "
            f"{' and '.join(maps)} there are maps); download it, or set the option has_map to false"
        )
    return read_city(maps[name])
