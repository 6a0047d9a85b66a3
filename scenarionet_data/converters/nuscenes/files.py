"""Find nuScenes' files: a release's tables, the maps of locations, and folders to skip."""

from __future__ import annotations

import re
from pathlib import Path

from scenarionet_data.converters.nuscenes.types import RELEASES
from scenarionet_data.errors import SourceNotFound

CHALLENGE = Path("maps", "prediction", "prediction_scenes.json")
EXPANSION = Path("maps", "expansion")
SENSORS = frozenset({"samples", "sweeps", "lidarseg", "panoptic", "images", "lidar", "train_images", "train_lidar"})
"""Folders with millions of images and point clouds, in nuScenes and Lyft's dataset."""


def dataroot(raw: Path) -> Path:
    """Return the dataroot: ``raw``, or its parent if ``raw`` is the folder of a release."""
    return raw.resolve().parent if (raw / "scene.json").is_file() else raw


def find_release(raw: Path, split: str) -> Path:
    """Find the folder of tables with a split.

    Raises:
        SourceNotFound: No such folder, or several.
    """
    is_release = (raw / "scene.json").is_file()
    folders = [raw.resolve()] if is_release else sorted(path.parent for path in raw.glob("*/scene.json"))
    if not folders:
        raise SourceNotFound(f"{raw}: no folder with scene.json; give the folder that contains v1.0-trainval and maps")
    fitting = [folder for folder in folders if split in RELEASES.get(folder.name, (split,))]
    if len(fitting) == 1:
        return fitting[0]
    found = ", ".join(folder.name for folder in fitting or folders)
    if fitting:
        raise SourceNotFound(f"{raw}: {found} may all have a split {split!r}; give the folder of one of them")
    has = ", ".join(name for folder in folders for name in RELEASES[folder.name])
    raise SourceNotFound(f"{raw}: {found} has no split {split!r}; give as split one of {has}")


def map_file(root: Path, place: str) -> Path:
    """Path of the map of a location, which may be missing."""
    return root / EXPANSION / f"{place}.json"


def map_id(place: str) -> str:
    """Id of a location's map."""
    return re.sub(r"[^A-Za-z0-9._-]", "-", place)
