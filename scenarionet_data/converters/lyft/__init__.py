"""Lyft Level 5's prediction dataset, in the zarr format of l5kit, without l5kit.

RAW is the dataset's folder, or one of the zarr folders in it:

    scenes/<name>.zarr               scenes of about 25 s at 10 Hz, format version 1 or 2
    semantic_map/semantic_map.pb     the map, there or anywhere in the dataset's folder
    meta.json                        the transform from the recordings' frame to the earth, likewise

The older perception dataset has nuScenes' format and is read by that converter.
"""

from __future__ import annotations

import os
import re
from collections.abc import Iterator, Sequence
from contextlib import suppress
from dataclasses import replace
from pathlib import Path

from scenarionet_data.building import MapBuilder
from scenarionet_data.converters.base import Budgets, Converter, unused_files
from scenarionet_data.converters.lyft.files import (
    DESCRIPTIONS,
    MAP_FILES,
    damaged_item,
    dataset_folder,
    description_files,
    find_map,
    find_recordings,
    scene_items,
    scene_of,
)
from scenarionet_data.converters.lyft.map_features import read_city
from scenarionet_data.converters.lyft.recording import TABLES, LyftRecording, LyftScene
from scenarionet_data.converters.lyft.scenario import CITY, MAP_ID, LyftOptions, LyftWindow, describe, windows
from scenarionet_data.errors import CorruptSource, InvalidScenario
from scenarionet_data.ingest.options import Options
from scenarionet_data.ingest.passed_over import PassedOver
from scenarionet_data.ingest.shard import RawItem, Shard, fingerprint
from scenarionet_data.scenario.description import ScenarioDescription

__all__ = ["Lyft", "LyftOptions"]

_BLOCK = 32
"""Number of consecutive scenes per shard, which share chunks; about 700,000 rows of agents."""


class Lyft(Converter[LyftWindow]):
    """One shard per block of scenes of a recording; the semantic map is shared by all."""

    name = "lyft"
    version = "2"
    release = "v1.0"
    licence = "CC BY-NC-SA 4.0"
    raw = "folder with scenes/*.zarr, semantic_map/semantic_map.pb and meta.json, or one of the zarr folders"
    Options = LyftOptions
    properties = ("location", "log", "date", "host")
    listed = (*DESCRIPTIONS, "*.zarr/scenes/*")
    # Measured in two windows: 0.5 and 0.7 m/s, 12 and 12 m/s, 1.6 and 2.0 rad, jumps of 79 and 84 m/s.
    budgets = Budgets(velocity_median=1.0, velocity_p99=15.0, heading_p99=2.2, step_speed=100.0)

    def shards(self, raw: str, split: str, version: str, options: LyftOptions) -> Iterator[Shard]:
        """List blocks of scenes, recording by recording."""
        root, recordings = dataset_folder(Path(raw)), find_recordings(Path(raw), split)
        maps = find_map(options.maps or str(root)) if options.has_map else []
        map_mark = fingerprint(maps) if maps else ""
        resolved = replace(options, maps=os.pathsep.join(map(str, maps)))  # saves workers the search
        for path in recordings:
            name = path.relative_to(root).as_posix()
            stem = re.sub(r"[^A-Za-z0-9._-]", "-", name.removesuffix(".zarr"))
            try:
                items = scene_items(LyftRecording(path), name, map_mark)
            except CorruptSource:  # reported when the shard is read, which fails alone
                items = [damaged_item(path, name)]
            for first in range(0, len(items), _BLOCK):
                block = tuple(items[first : first + _BLOCK])
                shard = f"{stem}-{first // _BLOCK:05d}"
                yield Shard(self.name, version, split, shard, str(root), block, resolved, {"location": CITY})

    def dataset_folder(self, raw: Path) -> Path:
        """The folder of the dataset above a recording."""
        return dataset_folder(raw)

    def files(self, shard: Shard) -> Iterator[list[str]]:
        """The map, the recordings' scenes, then the chunks of the shard's scenes."""
        root, maps = Path(shard.root), filter(None, shard.options_as(LyftOptions).maps.split(os.pathsep))
        names = {scene_of(item)[0] for item in shard.items}
        described = [Path(path) for path in maps] + [root / file for name in names for file in description_files(name)]
        yield _below(root, described)
        with suppress(CorruptSource):  # reported when the shard is read
            scenes = list(_scenes(shard))
            yield _below(root, [file for recording, scene in scenes for file in recording.frame_files(scene)])
            yield _below(
                root, [file for recording, scene in scenes for file in _content_files(shard, recording, scene)]
            )

    def records(self, shard: Shard) -> Iterator[LyftWindow]:
        """Yield the windows of the shard's scenes."""
        options = shard.options_as(LyftOptions)
        city = read_city(*find_map(options.maps or shard.root)) if options.has_map else None
        for recording, scene in _scenes(shard):
            yield from windows(recording, scene, options, city)

    def scenario(self, shard: Shard, record: LyftWindow) -> ScenarioDescription:
        """Convert a window."""
        return describe(shard, record, self.licence)

    def maps(self, raw: str, version: str, options: LyftOptions) -> Iterator[Shard]:
        """List the semantic map."""
        if options.has_map:
            find_recordings(Path(raw), split="")  # report missing recordings before a missing map
            root = dataset_folder(Path(raw))
            files = find_map(options.maps or str(root))
            folder = Path(os.path.commonpath(files)) if options.maps else root
            items = (RawItem(path.relative_to(folder).as_posix(), fingerprint([path])) for path in files)
            yield Shard(self.name, version, "", MAP_ID, str(folder), tuple(items), Options())

    def passed_over(self, raw: str, split: str, options: LyftOptions, shards: Sequence[Shard]) -> Iterator[PassedOver]:
        """List recordings of other splits, tables that are not read, a map that is not wanted, and other files."""
        taken = {Path(shard.root, scene_of(item)[0]) for shard in shards for item in shard.items}
        others = [path for path in find_recordings(Path(raw), split="") if path not in taken]
        if others:
            names = ", ".join(path.name for path in others)
            yield PassedOver(f"recordings {names}", len(others), f"of another split than {split}")

        def is_used(path: Path) -> bool:
            recording = next((parent for parent in path.parents if parent.suffix == ".zarr"), None)
            if recording is None:
                return options.has_map and path.name in MAP_FILES
            is_described = path.parent == recording and path.name.startswith(".z")
            return recording in others or is_described or path.parent.name in TABLES

        yield from unused_files(Path(raw), is_used)

    def map_features(self, shard: Shard) -> MapBuilder:
        """Read the semantic map."""
        return read_city(*shard.paths).features


def _scenes(shard: Shard) -> Iterator[tuple[LyftRecording, LyftScene]]:
    """Yield a shard's scenes with their recordings."""
    recording = None
    for name, row in map(scene_of, shard.items):
        if recording is None or recording.path != Path(shard.root, name):
            recording = LyftRecording(Path(shard.root, name))
        for scene in recording.scenes if row is None else [recording.scenes[row]]:
            yield recording, scene


def _content_files(shard: Shard, recording: LyftRecording, scene: LyftScene) -> Iterator[Path]:
    """Files with the agents and lights of a scene's windows; none for a scene that will be refused."""
    for window in windows(recording, scene, shard.options_as(LyftOptions), None):
        with suppress(InvalidScenario, CorruptSource):
            yield from recording.content_files(window.first, window.last, scene.name)


def _below(root: Path, paths: list[Path]) -> list[str]:
    """Names of the files below a folder, relative to it."""
    return [path.relative_to(root).as_posix() for path in paths if path.is_relative_to(root)]
