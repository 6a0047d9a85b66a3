"""Find the files of Lyft's dataset: recordings, the map, and the scenes of each recording as raw items."""

from __future__ import annotations

import hashlib
import os
from pathlib import Path

from scenarionet_data.converters.lyft.recording import LyftRecording
from scenarionet_data.errors import SourceNotFound
from scenarionet_data.ingest.listing import walk
from scenarionet_data.ingest.shard import RawItem, fingerprint

MAP_FILES = ("semantic_map.pb", "meta.json")
DESCRIPTIONS = (".zattrs", ".zarray")
_FINGERPRINT_SAMPLE = 4096
_SPLITS = {"train": "train", "train_full": "train", "validate": "val", "validate_full": "val", "test": "test"}
"""Splits by the names of Lyft's recordings."""


def dataset_folder(raw: Path) -> Path:
    """Return the dataset's folder: RAW, or the folder above it if RAW is a zarr folder."""
    if raw.suffix != ".zarr":
        return raw
    return raw.parent.parent if raw.parent.name == "scenes" else raw.parent


def find_recordings(raw: Path, split: str) -> list[Path]:
    """Find the zarr folders of RAW, without those named after another split than ``split``.

    Raises:
        SourceNotFound: No zarr folders.
    """
    found = [raw] if raw.suffix == ".zarr" and raw.is_dir() else _find(raw, ".zarr")
    others = set(_SPLITS.values()) - {split} if split in _SPLITS.values() else set()
    wanted = [path for path in found if path == raw or _SPLITS.get(path.stem) not in others]
    if not wanted:
        hint = f"; of another split are {', '.join(path.name for path in found)}" if found else ""
        of_split = f" of split {split}" if split else ""
        raise SourceNotFound(f"{raw}: no recordings (*.zarr){of_split} in it{hint}")
    return wanted


def _find(folder: Path, ending: str) -> list[Path]:
    """Find folders and files by suffix, sorted, without looking inside recordings."""
    found = []
    for place, folders, files in walk(folder):
        found += [Path(place, name) for name in (*folders, *files) if name.endswith(ending)]
        folders[:] = sorted(name for name in folders if not name.endswith(".zarr"))
    return sorted(found)


def find_map(places: str) -> list[Path]:
    """Find ``semantic_map.pb`` and ``meta.json``.

    Args:
        places: Folders that contain them at any depth, or the files, separated as in ``$PATH``.

    Raises:
        SourceNotFound: One of them is missing, or there are several.
    """
    chosen = []
    for name in MAP_FILES:
        found = [path for place in map(Path, places.split(os.pathsep)) for path in _named(place, name)]
        if len(found) != 1:
            count = f"found {len(found)}: {', '.join(map(str, found))}" if found else "found none"
            hint = "download the dataset's semantic map, or set the option has_map to false"
            raise SourceNotFound(f"{places}: expected one {name} in it, {count}; {hint}")
        chosen += found
    return chosen


def _named(place: Path, name: str) -> list[Path]:
    """A file of this name, or the files of this name in a folder."""
    found = _find(place, name) if place.is_dir() else [place]
    return [path for path in found if path.name == name and path.is_file()]


def description_files(recording: str) -> list[str]:
    """Files with a recording's scenes and the chunk layout of its tables; one name is a pattern."""
    tables = ("frames", "agents", "traffic_light_faces")
    return [f"{recording}/.zattrs", f"{recording}/scenes/*", *(f"{recording}/{table}/.zarray" for table in tables)]


def scene_items(recording: LyftRecording, name: str, map_mark: str) -> list[RawItem]:
    """Scenes of a recording as items, identified by row, with fingerprints of their frames and the map."""
    marks: dict[Path, str] = {}
    items = []
    for scene in recording.scenes:
        parts = [repr(scene), map_mark]
        for file in recording.frame_files(scene):
            if file not in marks:
                marks[file] = fingerprint([file], _FINGERPRINT_SAMPLE) if file.is_file() else ""
            parts.append(marks[file])
        mark = hashlib.blake2b("\n".join(parts).encode(), digest_size=8).hexdigest()
        properties = {"log": scene.name, "host": scene.host, "date": scene.date}
        items.append(RawItem(f"{name}:{scene.index}", mark, properties))
    return items


def damaged_item(path: Path, name: str) -> RawItem:
    """Item for all scenes of a recording whose tables cannot be read."""
    return RawItem(name, fingerprint(sorted(file for file in path.rglob(".z*") if file.is_file())))


def scene_of(item: RawItem) -> tuple[str, int | None]:
    """Return the name of an item's recording, and the row of its scene; None for all scenes."""
    name, _, number = item.name.rpartition(":")
    return (name, int(number)) if number.isdigit() else (item.name, None)
