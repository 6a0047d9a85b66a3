"""Tables of your own: tracks as CSV or Parquet, with a map as GeoJSON, Lanelet2 or OpenDRIVE.

RAW is a file, or a folder of files, with one row per road user and time; ``columns.toml`` says what the columns hold.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from scenarionet_data.building import MapBuilder
from scenarionet_data.converters.base import Budgets, Converter, find_files
from scenarionet_data.converters.cities import CityMap
from scenarionet_data.converters.formats.map_files import read_map
from scenarionet_data.converters.table.columns import DEGREES, read_columns
from scenarionet_data.converters.table.contradictions import find_contradictions
from scenarionet_data.converters.table.rows import read_rows
from scenarionet_data.converters.table.windows import TrackWindow, WindowOptions, cut, describe
from scenarionet_data.errors import CorruptSource, SourceNotFound
from scenarionet_data.ingest.defects import Defects
from scenarionet_data.ingest.listing import cached_by_file
from scenarionet_data.ingest.options import option
from scenarionet_data.ingest.shard import RawItem, Shard, fingerprint
from scenarionet_data.scenario.description import ScenarioDescription, Source

_ENDINGS = (".csv", ".parquet")


@dataclass(frozen=True)
class TableOptions(WindowOptions):
    """TableColumns, map, windows and egos."""

    columns: str = option("", "columns.toml: what the columns hold.", is_path=True)
    map: str = option("", "Map of all files: *.geojson, *.osm (Lanelet2), *.xodr.", is_path=True)
    trust: bool = option(False, "Convert tables that contradict themselves or the map, too.")


class TrackTable(Converter[TrackWindow]):
    """One shard per file; the map is shared."""

    name = "table"
    version = "1"
    release = "v1"
    licence = "that of the table"
    raw = "a file *.csv or *.parquet with one row per road user and time, or a folder of such files"
    Options = TableOptions
    properties = ("log",)
    budgets = Budgets()

    def shards(self, raw: str, split: str, version: str, options: TableOptions) -> Iterator[Shard]:
        """List files."""
        known = [Path(path) for path in (options.columns, options.map) if path]
        for path in known:
            if not path.is_file():
                raise SourceNotFound(f"{path}: no such file; the options columns and map name files")
        read_columns(options.columns)
        root = Path(raw) if Path(raw).is_dir() else Path(raw).parent
        found = [path for path in find_files(raw, "*", self.raw, split) if path.suffix in _ENDINGS]
        if not found:
            raise SourceNotFound(f"{raw}: expected {' or '.join(_ENDINGS)}, found none; give {self.raw}")
        for path in found:
            log = path.relative_to(root).with_suffix("").as_posix()
            item = RawItem(path.relative_to(root).as_posix(), fingerprint([path, *known]))
            yield Shard(
                self.name, version, split, re.sub(r"[^A-Za-z0-9._-]", "-", item.name), str(root), (item,), options,
                {"log": log},
            )  # fmt: skip

    def files(self, shard: Shard) -> Iterator[list[str]]:
        """The table, and its columns and map if they are below the same folder."""
        options, root = shard.options_as(TableOptions), Path(shard.root)
        beside = [Path(path) for path in (options.columns, options.map) if path]
        near = [path.relative_to(root).as_posix() for path in beside if path.is_relative_to(root)]
        yield [*near, *(item.name for item in shard.items)]

    def maps(self, raw: str, version: str, options: TableOptions) -> Iterator[Shard]:  # noqa: ARG002
        """The map."""
        if options.map:
            path = Path(options.map)
            item = RawItem(path.name, fingerprint([path, *([Path(options.columns)] if options.columns else [])]))
            yield Shard(self.name, version, "", path.stem, str(path.parent), (item,), options)

    def map_features(self, shard: Shard) -> MapBuilder:
        """Read the map."""
        options = shard.options_as(TableOptions)
        return _read_city(Path(options.map), options.columns).features

    def records(self, shard: Shard) -> Iterator[TrackWindow]:
        """Read a file and cut it into windows.

        Raises:
            CorruptSource: It cannot be read, or contradicts itself or the map.
        """
        options, defects, file = shard.options_as(TableOptions), Defects(), shard.items[0].name
        rows, clock = read_rows(shard.paths[0], file, read_columns(options.columns), defects)
        city = _read_city(Path(options.map), options.columns) if options.map else None
        contradictions = find_contradictions(rows, clock, city.bounds if city else None)
        if contradictions and not options.trust:
            raise CorruptSource(
                f"{shard.paths[0]}: {'; '.join(contradictions)}. Say what is so in columns.toml, or convert it as "
                "it is with -p trust=true"
            )
        number = np.bincount(rows.track)
        first = np.flatnonzero(np.diff(rows.track, prepend=-1))
        missing = rows.frame[np.append(first[1:], len(rows.frame)) - 1] - rows.frame[first] + 1 - number
        reason = "expected a row for each timestep from a track's first to its last, found gaps, where it is not valid"
        defects.assume("tracks", file, [f"track {name}" for name in rows.ids[missing > 0]], "time", reason)
        yield from cut(rows, clock, options, defects)

    def scenario(self, shard: Shard, record: TrackWindow) -> ScenarioDescription:
        """Convert a window."""
        options, log = shard.options_as(TableOptions), str(shard.properties["log"])
        columns = read_columns(options.columns)
        city = _read_city(Path(options.map), options.columns) if options.map else None
        source = Source(
            log,
            shard.items[0].name,
            columns.licence,
            log=log,
            crs=f"metres from {columns.origin}" if columns.origin else "metres",
        )
        has_z = bool(record.rows.height.any())
        return describe(shard, record, source, city, Path(options.map).stem if options.map else None, has_z)


@cached_by_file(4)
def _read_city(path: Path, columns: str) -> CityMap:
    told = read_columns(columns)
    return CityMap(read_map(path, told.origin, told.to_metres if told.map_unit == DEGREES else None))
