"""Names of splits: the spelling of the lake, and the split of raw recordings guessed from folder names."""

from __future__ import annotations

import os
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path, PurePath

from scenarionet_data.errors import BadParameter

_SPLITS = {
    "train": "train",
    "training": "train",
    "training_20s": "train",
    "val": "val",
    "validation": "val",
    "validation_interactive": "validation_interactive",
    "test": "test",
    "testing": "test",
    "testing_interactive": "testing_interactive",
    "test_obs": "test",
    "mini": "mini",
    "v1.0-mini": "mini",
    "v1.0-trainval": "train",
    "v1.0-test": "test",
}
_ALIASES = {
    **{name: split for name, split in _SPLITS.items() if name != "v1.0-trainval"},  # a release with two splits
    "train_full": "train",
    "validate": "val",
    "validate_full": "val",
}
ACCEPTED: Mapping[str, tuple[str, ...]] = {
    "waymo": (
        *("train", "val", "test"),
        *("training", "training_20s", "validation", "validation_interactive", "testing", "testing_interactive"),
    ),
    "nuplan": ("train", "val", "test", "mini"),
    "nuscenes": ("train", "val", "train_val", "test", "mini", "mini_train", "mini_val", "v1.0-mini", "v1.0-test"),
    "lyft": ("train", "val", "test", "train_full", "validate", "validate_full"),
    "argoverse1": ("train", "val", "test", "test_obs"),
    "argoverse2": ("train", "val", "test"),
    **dict.fromkeys(
        ("commonroad", "gpudrive", "interaction", "openscenario", "pufferdrive", "sumo", "table"),
        ("train", "val", "test"),
    ),
}
"""Names of splits by dataset: those of the lake, and those of the dataset's folders. Others become labels."""

_MANY = 64


def lake_spelling(split: str) -> str:
    """Return the lake's name of a split that may be spelled as in the dataset's folders; other names are unchanged.

    Example:
        >>> lake_spelling("validation"), lake_spelling("test_obs"), lake_spelling("mini_val")
        ('val', 'test', 'mini_val')
    """
    return _ALIASES.get(split.lower(), split)


def split_folder(raw: str, split: str) -> str:
    """Return the folder in ``raw`` named ``split`` if another one is of the same split of the lake, else ``raw``.

    Waymo has two such folders, ``training`` with windows of nine seconds and ``training_20s`` with whole recordings.

    Raises:
        BadParameter: The folder contains several such folders, and the split is named as in the lake.
    """
    folders = [path for path in _split_folders(Path(raw)) if _SPLITS[path.name.lower()] == lake_spelling(split)]
    names = sorted({path.name.lower() for path in folders})
    if len(names) < 2:
        return raw
    for path in folders:
        if path.name.lower() == split.lower():
            return str(path)
    raise BadParameter(
        f"{raw}: contains the folders {' and '.join(names)}, all of them split {lake_spelling(split)}; choose one, for "
        f"example split='{names[0]}'"
    )


def guess_split(raw: str, top: str = "") -> str:
    """Return the split named by ``raw`` or a folder above it, else by the folders in it, else ``train``.

    Args:
        raw: Folder or file.
        top: Folder above ``raw`` at which the search for a name ends; by default the root.

    Raises:
        BadParameter: The folder contains several splits.

    Example:
        >>> guess_split("/data/waymo/validation")
        'val'
    """
    named = PurePath(raw).relative_to(top) if top else PurePath(raw)
    for part in reversed(named.parts):
        if part.lower() in _SPLITS:
            return _SPLITS[part.lower()]
    inside = sorted({_SPLITS[path.name.lower()] for path in _split_folders(Path(raw))})
    if len(inside) > 1:
        raise BadParameter(
            f"{raw}: contains the splits {', '.join(inside)}; choose one, for example split='{inside[0]}'"
        )
    return inside[0] if inside else "train"


def _split_folders(folder: Path, depth: int = 3) -> Iterator[Path]:
    """Return the folders named after splits at most ``depth`` levels down."""
    if not depth or not folder.is_dir():
        return
    with os.scandir(folder) as entries:
        inside = sorted(entry.name for entry in entries if entry.is_dir())
    yield from (folder / name for name in inside if name.lower() in _SPLITS)
    others = [name for name in inside if name.lower() not in _SPLITS]
    for name in others if len(others) <= _MANY else []:  # a folder of many folders contains recordings, not splits
        yield from _split_folders(folder / name, depth - 1)


def is_of_split(path: Path, root: Path, split: str) -> bool:
    """Whether no folder between ``root`` and ``path`` is named after another split."""
    return set(splits_of([path], root)) <= {lake_spelling(split)}


def splits_of(paths: Iterable[Path], root: Path) -> list[str]:
    """Return the splits that the folders between ``root`` and some files are named after, sorted."""
    names = {part.lower() for path in paths for part in path.relative_to(root).parts[:-1]}
    return sorted({_SPLITS[name] for name in names & _SPLITS.keys()})
