"""Find nuPlan's files: the logs of a split, and the maps with the list of their versions."""

from __future__ import annotations

import json
import os
import re
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path

from scenarionet_data.converters.nuplan.log import LogLocation, opened, read_place, read_tag_types
from scenarionet_data.errors import CorruptSource, SourceNotFound
from scenarionet_data.ingest.input_properties import InputProperties, LazyProperties, is_local
from scenarionet_data.ingest.listing import walk

_SPLITS = {"mini", "train", "val", "test"}
SENSORS = frozenset({"sensor_blobs"})
"""Folders with millions of images and point clouds, which are not searched."""
MANIFESTS = "nuplan-maps-v*.json"
"""File with the list of map versions."""
_NAME = re.compile(r"[A-Za-z0-9._-]{1,128}")
_MANIFEST = re.compile(r"nuplan-maps-v[\d.]+\.json")


def find_logs(root: Path) -> list[Path]:
    """Find the logs below a folder, sorted.

    Raises:
        SourceNotFound: No logs.
    """
    logs = sorted(path for path in _walk(root) if path.suffix == ".db")
    if not logs:
        raise SourceNotFound(f"{root}: no *.db in it; give the folder of nuPlan's logs, for example splits/mini")
    return logs


def logs_of(split: str, root: Path) -> list[Path]:
    """Find the logs below a folder, except those in folders of another split.

    Raises:
        SourceNotFound: No logs, or two of the same name.
    """
    logs = find_logs(root)
    others = _SPLITS - {split} if split in _SPLITS else set()
    kept = [log for log in logs if others.isdisjoint(log.relative_to(root).parts)]
    if not kept:
        found = sorted(others & {part for log in logs for part in log.relative_to(root).parts})
        raise SourceNotFound(f"{root}: no logs of split {split} in it, but of {', '.join(found)}; add --split")
    by_name: dict[str, Path] = {}
    for log in kept:
        if by_name.setdefault(log.stem, log) != log:
            raise SourceNotFound(f"{log} and {by_name[log.stem]} are the same log; give a folder that contains it once")
    return kept


def place_of(log: Path) -> LogLocation:
    """Place of a log; unknown if it is not local or cannot be read, which its shard reports."""
    if not is_local(log):
        return LogLocation("", "", None)
    try:
        with opened(log) as database:
            return read_place(database, log)
    except CorruptSource:
        return LogLocation("", "", None)


def properties_of(log: Path, place: LogLocation) -> InputProperties:
    """Input properties of a log; tags are read lazily, as they fill megabytes."""
    told = {"location": place.map_name, "log": log.stem, "date": place.date}
    return LazyProperties({key: value for key, value in told.items() if value}, ("tag",), _tags_of, log)


def _tags_of(log: Path, _key: str) -> tuple[str, ...]:
    """Types of a log's tags; none if it cannot be read, which its shard reports."""
    try:
        with opened(log) as database:
            return read_tag_types(database)
    except CorruptSource:
        return ()


@dataclass(frozen=True)
class Atlas:
    """The maps folder.

    Attributes:
        manifest: Its ``nuplan-maps-v1.0.json``.
        versions: Version of the map of each location.
    """

    manifest: Path
    versions: dict[str, str]

    @property
    def root(self) -> Path:
        """The folder."""
        return self.manifest.parent

    def candidates(self, place: LogLocation) -> dict[str, Path]:
        """Paths of the maps of a place by map id, in order of preference."""
        names = [name for name in (place.map_name, place.city) if name in self.versions]
        return {f"{name}-{self.versions[name]}": self.root / name / self.versions[name] / "map.gpkg" for name in names}

    def find(self, place: LogLocation) -> tuple[str, Path] | None:
        """Id and path of the map of a place, or None."""
        found = self.candidates(place).items()
        return next(((map_id, path) for map_id, path in found if path.is_file()), None)

    def maps_of(self, logs: Iterable[Path]) -> dict[str, Path]:
        """Paths of the maps of some logs by id; of all maps if a log is not local."""
        places = {place_of(log) if is_local(log) else None for log in logs}
        if None in places:
            places = {LogLocation(name, name, None) for name in self.versions}
        return dict(sorted(found for place in places if place and (found := self.find(place))))

    def map_of(self, place: LogLocation, log: Path) -> tuple[str, Path]:
        """Id and path of the map of a log's place.

        Raises:
            SourceNotFound: No map of this place.
        """
        found = self.find(place)
        if found is None:
            known = ", ".join(self.versions) or "none"
            where = f"{log}: recorded at {place.map_name!r}, whose map.gpkg is not in {self.root}"
            raise SourceNotFound(f"{where} (it lists {known}); download nuPlan's maps")
        return found


def find_atlas(root: Path, maps: str) -> Atlas:
    """Find the maps folder: the given one, or below the logs' folder, or ``$NUPLAN_MAPS_ROOT``.

    Raises:
        SourceNotFound: None of them has a list of map versions.
        CorruptSource: The list cannot be read.
    """
    places = [Path(maps)] if maps else [root, Path(os.environ.get("NUPLAN_MAPS_ROOT", root))]
    for place in places:
        found = sorted(path for path in _walk(place) if _MANIFEST.fullmatch(path.name))
        if found:
            return Atlas(found[-1], _versions(found[-1]))
    where = " or ".join(dict.fromkeys(map(str, places)))
    raise SourceNotFound(f"{where}: no nuplan-maps-v1.0.json in it; set NUPLAN_MAPS_ROOT to nuPlan's maps folder")


def _versions(manifest: Path) -> dict[str, str]:
    """Version of each location with a usable entry."""
    wanted = "expected map versions"
    try:
        entries = json.loads(manifest.read_bytes())
    except (OSError, ValueError, RecursionError) as error:
        raise CorruptSource(f"{manifest}: {wanted}, found no JSON; download the maps again") from error
    stated = {
        location: str(entry["version"])
        for location, entry in (entries.items() if isinstance(entries, dict) else ())
        if isinstance(entry, dict) and isinstance(entry.get("version"), str | int | float)
    }
    found = {place: version for place, version in stated.items() if _NAME.fullmatch(f"{place}-{version}")}
    if not found:
        raise CorruptSource(f"{manifest}: {wanted} by location, found none; download the maps again")
    return found


def _walk(root: Path) -> Iterator[Path]:
    for folder, subfolders, files in walk(root):
        subfolders[:] = [name for name in subfolders if name not in SENSORS]
        yield from (Path(folder, name) for name in files)
