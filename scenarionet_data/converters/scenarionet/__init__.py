"""ScenarioNet's and MetaDrive's pickles of every version, one scenario per file.

RAW is a database (a folder with ``dataset_mapping.pkl``, which may refer to other folders), a folder of pickles with or
without summary, or a folder of such folders. Format: ``metadrive/scenario/scenario_description.py`` of
MetaDrive 0.4.3 and the converters of ScenarioNet (2025-03), whose output deviates from it:

* nuScenes: sizes (T, 1), ``valid`` float, the ego's length and width exchanged, headings as the third coordinate
  of lanes, 100 km/h on connectors without a limit in the source, velocities by finite differences;
* Waymo: links as int while ids are str, values at invalid states, headings that are not wrapped;
* Argoverse 2: one assumed size per type, 85 mph everywhere, widths of 0;
* MetaDrive's own: cones without size, extra states (steering, ...), 1000 km/h for no limit;
* nuPlan: coordinates relative to the ego's first position, which is lost; 2D stop points.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from functools import lru_cache
from pathlib import Path
from typing import Any

from scenarionet_data.converters.base import Converter, find_files, unused_files
from scenarionet_data.converters.scenarionet.scenario import UNKNOWN_LICENCE, make_scenario
from scenarionet_data.converters.scenarionet.unpickling import load
from scenarionet_data.converters.scenarionet.usable import UNREADABLE, explain
from scenarionet_data.errors import CorruptSource, InvalidScenario, SourceNotFound
from scenarionet_data.ingest.input_properties import InputProperties, LazyProperties
from scenarionet_data.ingest.options import Options
from scenarionet_data.ingest.passed_over import PassedOver
from scenarionet_data.ingest.shard import ABSENT, RawItem, Shard, bucket, fingerprint
from scenarionet_data.scenario.description import ScenarioDescription

SUMMARY = "dataset_summary.pkl"
SUMMARISED = {"dataset": "dataset", "location": "map", "log": "log_name", "date": "date"}
"""Input properties by name, and their keys in the summary."""


def properties_of(pickle: Path) -> InputProperties:
    """Return the properties of a scenario from the summary in its folder; read lazily."""
    return LazyProperties({}, tuple(SUMMARISED), _fact, pickle)


def _fact(pickle: Path, key: str) -> str | tuple[str, ...]:
    metadata = _summary(pickle.parent).get(pickle.name)
    value = metadata.get(SUMMARISED[key]) if isinstance(metadata, dict) else None
    return () if value is None else str(value)


@lru_cache(maxsize=2)
def _summary(folder: Path) -> dict[str, Any]:
    """Metadata by file name; empty if the summary is missing or unreadable."""
    path = folder / SUMMARY
    try:
        return load(path, path.name)
    except InvalidScenario:  # the scenarios can be converted without a summary
        return {}


_MAPPING = "dataset_mapping.pkl"
_FORM = {
    "version": str,
    "length": int,
    "tracks": dict,
    "dynamic_map_states": dict,
    "map_features": dict,
    "metadata": dict,
}


class ScenarioNetPickles(Converter[RawItem]):
    """Converter of databases written by ScenarioNet, MetaDrive, or this project's export."""

    name = "scenarionet"
    version = "2"
    release = "v1"
    licence = UNKNOWN_LICENCE
    raw = "folder of ScenarioNet pickles (sd_*.pkl), or of such folders"
    listed = (_MAPPING,)
    properties = tuple(SUMMARISED)

    def shards(self, raw: str, split: str, version: str, options: Options) -> Iterator[Shard]:
        """List buckets of pickles, by a hash of their names."""
        root = Path(raw) if Path(raw).is_dir() else Path(raw).parent
        items = []
        for name in _list_pickles(raw):
            path = root / name
            items.append(RawItem(name, _fingerprint(path), properties_of(path)))
        for name, members in bucket(items).items():
            yield Shard(self.name, version, split, name, str(root), members, options)

    def records(self, shard: Shard) -> Iterator[RawItem]:
        """Yield the shard's files, which ``scenario`` reads, so that a damaged file affects one scenario only."""
        yield from shard.items

    def scenario(self, shard: Shard, record: RawItem) -> ScenarioDescription:
        """Read one pickle."""
        path = Path(shard.root) / record.name
        if not path.is_file():
            advice = f"is missing, although {_MAPPING} lists it; restore it and run the same command again"
            raise InvalidScenario(record.name, "pickle", advice)
        description = load(path, record.name)
        for key, kind in _FORM.items():
            if key not in description:
                wanted = f"expected a {kind.__name__} named {key!r}, as in pickles since MetaDrive 0.3 (spring 2023)"
                raise InvalidScenario(record.name, key, f"{wanted}, found none; convert older ones' recordings again")
            if not isinstance(description[key], kind):
                found = type(description[key]).__name__
                raise InvalidScenario(record.name, key, f"expected {kind.__name__}, found {found}")
        try:
            return make_scenario(shard, record.name, description)
        except InvalidScenario:
            raise
        except UNREADABLE as error:
            raise InvalidScenario(record.name, "pickle", explain(error)[1]) from error

    def passed_over(self, raw: str, split: str, options: Options, shards: Sequence[Shard]) -> Iterable[PassedOver]:
        """List files that are not pickles of scenarios, and pickles that the mapping does not name."""
        folder = Path(raw)
        if not (folder / _MAPPING).is_file():
            yield from super().passed_over(raw, split, options, shards)
            return
        inputs = {path.resolve() for shard in shards for path in shard.paths}
        others = [path for path in folder.rglob("*.pkl") if _is_scenario(path) and path.resolve() not in inputs]
        if others:
            example = min(others).relative_to(folder).as_posix()
            yield PassedOver(
                f"pickles of scenarios, for example {example}", len(others), f"{_MAPPING} does not name them"
            )
        taken = inputs | {path.resolve() for path in others}
        yield from unused_files(
            folder, lambda path: path.resolve() in taken or path.name in (_MAPPING, SUMMARY), split, self.ignored
        )


def _list_pickles(raw: str) -> list[str]:
    """List the scenarios' files relative to the raw folder: the files in its mapping, or all files without one.

    Raises:
        SourceNotFound: No scenarios, or none of those in the mapping is present.
        CorruptSource: The mapping cannot be read.
    """
    mapping = Path(raw) / _MAPPING
    if not mapping.is_file():
        root = Path(raw)
        files = find_files(raw, "*.pkl", "ScenarioNet pickles (sd_*.pkl)")
        names = [
            path.relative_to(root).as_posix() if path != root else path.name for path in files if _is_scenario(path)
        ]
        if not names:
            raise SourceNotFound(f"{raw}: no pickle named sd_*.pkl or 0.pkl, 1.pkl, ... in it")
        return names
    try:
        folders = load(mapping, str(mapping))
        names = [(Path(str(folder)) / str(file)).as_posix() for file, folder in folders.items()]
    except InvalidScenario as error:
        raise CorruptSource(f"{mapping}: {error.reason}; copy it again, or remove it to take every pickle") from error
    if names and not any((Path(raw) / name).is_file() for name in names):
        raise SourceNotFound(f"{raw}: all {len(names)} files that its mapping lists are missing, such as {names[0]}")
    return names


def _fingerprint(path: Path) -> str:
    try:
        return fingerprint([path])
    except CorruptSource:  # missing, or unreadable: one scenario in quarantine
        return ABSENT


def _is_scenario(path: Path) -> bool:
    return path.stem.startswith("sd_") or path.stem.isdigit()
