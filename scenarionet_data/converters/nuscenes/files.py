"""Where nuScenes' files are: a release's tables, the locations' maps, and what is by the million and not read."""

from __future__ import annotations

import re
from pathlib import Path

from scenarionet_data.converters.nuscenes.types import RELEASES
from scenarionet_data.errors import SourceNotFound

CHALLENGE = Path("maps", "prediction", "prediction_scenes.json")
EXPANSION = Path("maps", "expansion")
SENSORS = frozenset({"samples", "sweeps", "lidarseg", "panoptic", "images", "lidar", "train_images", "train_lidar"})
"""Folders of images and point clouds, by the million, here and in Lyft's dataset."""


def dataroot(raw: Path) -> Path:
    """The dataroot: ``raw``, or the folder that it lies in when it is a release's."""
    return raw.resolve().parent if (raw / "scene.json").is_file() else raw


def find_release(raw: Path, split: str) -> Path:
    """The folder of tables that has a split.

    Raises:
        SourceNotFound: There is none, or several.
    """
    is_release = (raw / "scene.json").is_file()
    folders = [raw.resolve()] if is_release else sorted(path.parent for path in raw.glob("*/scene.json"))
    if not folders:
        raise SourceNotFound(f"{raw}: no folder with scene.json; give the folder that holds v1.0-trainval and maps")
    fitting = [folder for folder in folders if split in RELEASES.get(folder.name, (split,))]
    if len(fitting) == 1:
        return fitting[0]
    found = ", ".join(folder.name for folder in fitting or folders)
    if fitting:
        raise SourceNotFound(f"{raw}: {found} may all have a split {split!r}; give the folder of one of them")
    has = ", ".join(name for folder in folders for name in RELEASES[folder.name])
    raise SourceNotFound(f"{raw}: {found} has no split {split!r}; add --split with one of {has}")


def map_file(root: Path, place: str) -> Path:
    """The map of a location, which may be missing."""
    return root / EXPANSION / f"{place}.json"


def map_id(place: str) -> str:
    """The id of a location's map."""
    return re.sub(r"[^A-Za-z0-9._-]", "-", place)
