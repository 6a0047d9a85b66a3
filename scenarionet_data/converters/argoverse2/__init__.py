"""Argoverse 2 (https://www.argoverse.org/av2.html): motion forecasting scenarios and sensor logs, without av2.

RAW is a folder that contains either or both, at any depth:

    <split>/<scenario>/scenario_<id>.parquet + log_map_archive_<id>.json                      motion forecasting
    <split>/<log>/annotations.feather + city_SE3_egovehicle.feather + map/log_map_archive_*.json          sensor

The logs of the scenario mining dataset have ``annotations_with_ego.feather`` instead, with the ego's boxes, which are
left out: the ego comes from its poses.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from scenarionet_data.converters.argoverse2.forecasting import read_scenario
from scenarionet_data.converters.argoverse2.sensor import (
    ANNOTATIONS,
    DT,
    Argoverse2Window,
    annotations_in,
    city_of,
    describe,
    log_files,
    log_patterns,
    read_log,
    windows,
)
from scenarionet_data.converters.argoverse2.table import word_in_footer
from scenarionet_data.converters.base import Budgets, Converter
from scenarionet_data.errors import BadParameter, SourceNotFound
from scenarionet_data.ingest.input_properties import InputProperties, LazyProperties
from scenarionet_data.ingest.listing import walk
from scenarionet_data.ingest.options import Options, option
from scenarionet_data.ingest.shard import RawItem, Shard, bucket, fingerprint
from scenarionet_data.scenario.description import ScenarioDescription

_SPLITS = {"train", "val", "test"}
_FINGERPRINT_SAMPLE = 4096
"""Bytes hashed at each end of a file: there are 500,000 files of 100 kB to list."""


@dataclass(frozen=True)
class Argoverse2Options(Options):
    """Kind of recordings, and windows of sensor logs."""

    kind: str = option("auto", "forecasting, sensor, or auto: whichever RAW contains.")
    window: float = option(
        20.0, "Length of a scenario cut from a sensor log [s]. Logs last about 16 s: 20 converts them whole."
    )
    stride: float = option(0.0, "Time between the starts of two windows of a sensor log [s]; 0: the window.")

    def __post_init__(self) -> None:
        if self.kind not in ("auto", "forecasting", "sensor"):
            raise BadParameter(f"kind: expected auto, forecasting or sensor, found {self.kind!r}")
        if not (self.window >= DT and (self.stride == 0 or self.stride >= DT)):
            found = f"found {self.window} and {self.stride}"
            raise BadParameter(f"window, stride: expected {DT} s or more (or a stride of 0), {found}")


class Argoverse2(Converter[RawItem | Argoverse2Window]):
    """The motion forecasting dataset in buckets of scenarios, the sensor dataset with one log per shard."""

    name = "argoverse2"
    version = "2"
    release = "v2"
    licence = "CC BY-NC-SA 4.0"
    raw = "folder of motion forecasting scenarios (scenario_*.parquet) or sensor logs (annotations.feather)"
    Options = Argoverse2Options
    properties = ("kind", "log", "location")
    budgets = Budgets(velocity_median=0.5, velocity_p99=5.0, heading_p99=1.0)
    ignored = frozenset({"sensors"})

    def shards(self, raw: str, split: str, version: str, options: Argoverse2Options) -> Iterator[Shard]:
        """List buckets of forecasting scenarios, then sensor logs."""
        scenarios, logs = _find(Path(raw), split, options.kind)
        items = [
            _item(
                raw,
                path,
                [file for file in _scenario_pair(path) if file.is_file()],
                LazyProperties({}, ("location",), _fact, path),
            )
            for path in scenarios
        ]
        for name, members in bucket(items).items():
            yield Shard(
                self.name, version, split, f"forecasting-{name}", raw, members, options, {"kind": "forecasting"}
            )
        for path in logs:
            name = "sensor-" + re.sub(r"[^A-Za-z0-9._-]", "-", path.resolve().parent.name)
            items = [_item(raw, path, log_files(path), {})]
            properties = {"kind": "sensor", "log": path.resolve().parent.name, "location": city_of(path) or ""}
            yield Shard(self.name, version, split, name, raw, tuple(items), options, properties)

    def files(self, shard: Shard) -> Iterator[list[str]]:
        """Tables and maps, without sensor data."""
        paths = [Path(item.name) for item in shard.items]
        read = [log_patterns(path) if _is_log(path) else _scenario_pair(path) for path in paths]
        yield [file.as_posix() for files in read for file in files]

    def records(self, shard: Shard) -> Iterator[RawItem | Argoverse2Window]:
        """Yield scenario folders, or the windows of a sensor log."""
        options = shard.options_as(Argoverse2Options)
        for item, path in zip(shard.items, shard.paths, strict=True):
            if _is_log(path):
                yield from windows(read_log(path, item.name), options.window, options.stride or options.window)
            else:
                yield item

    def scenario(self, shard: Shard, record: RawItem | Argoverse2Window) -> ScenarioDescription:
        """Convert a scenario's folder, or a window of a log."""
        if isinstance(record, Argoverse2Window):
            return describe(shard, record, self.licence)
        return read_scenario(shard, record, self.licence)


def _find(raw: Path, split: str, kind: str) -> tuple[list[Path], list[Path]]:
    """Find scenario Parquet files and annotation files below ``raw``, sorted.

    Folders of another split are skipped, so that RAW may be the whole dataset; so are the contents of logs, with
    thousands of images.

    Raises:
        SourceNotFound: No such files.
    """
    others = _SPLITS - {split} if split in _SPLITS else set()
    scenarios: list[Path] = []
    logs: list[Path] = []
    for folder, subfolders, files in walk(raw):
        annotations = annotations_in(files)
        if annotations:
            logs.append(Path(folder, annotations))
        subfolders[:] = [] if annotations else sorted(set(subfolders) - others)
        found = (name for name in files if name.startswith("scenario_") and name.endswith(".parquet"))
        scenarios += (Path(folder, name) for name in found)
    scenarios, logs = ([] if kind == "sensor" else scenarios), ([] if kind == "forecasting" else logs)
    if not scenarios and not logs:
        wanted = f"no scenario_*.parquet and no {' or '.join(ANNOTATIONS)}"
        hint = f"give the folder of split {split}, or of the whole dataset" + (
            "" if kind == "auto" else f", or another kind than {kind}"
        )
        raise SourceNotFound(f"{raw}: {wanted} in it; {hint}")
    return sorted(scenarios), sorted(logs)


def _item(raw: str, path: Path, files: list[Path], properties: InputProperties) -> RawItem:
    return RawItem(path.relative_to(raw).as_posix(), fingerprint(files, _FINGERPRINT_SAMPLE), properties)


def _fact(scenario: Path, _key: str) -> str | tuple[str, ...]:
    return word_in_footer(scenario, "city") or ()


def _scenario_pair(path: Path) -> list[Path]:
    """Files of a scenario: its Parquet file and its map."""
    return [path, path.with_name(f"log_map_archive_{path.stem.removeprefix('scenario_')}.json")]


def _is_log(path: Path) -> bool:
    return path.name in ANNOTATIONS
