"""Names of splits: the spelling of the lake, and the split of raw recordings guessed from folder names."""

from __future__ import annotations

import os
from collections.abc import Iterator
from pathlib import Path, PurePath

from scenarionet_data.errors import BadParameter

_SPLITS = {
    "train": "train",
    "training": "train",
    "training_20s": "train",
    "val": "val",
    "validation": "val",
    "test": "test",
    "testing": "test",
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
_MANY = 64


def lake_spelling(split: str) -> str:
    """Return the lake's name of a split that may be spelled as in the dataset's folders; other names are unchanged.

    Example:
        >>> lake_spelling("validation"), lake_spelling("test_obs"), lake_spelling("mini_val")
        ('val', 'test', 'mini_val')
    """
    return _ALIASES.get(split.lower(), split)


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
    inside = sorted({_SPLITS[name] for name in _split_folders(Path(raw))})
    if len(inside) > 1:
        raise BadParameter(
            f"{raw}: contains the splits {', '.join(inside)}; choose one, for example split='{inside[0]}'"
        )
    return inside[0] if inside else "train"


def _split_folders(folder: Path, depth: int = 3) -> Iterator[str]:
    """Return the names of splits among the folders at most ``depth`` levels down."""
    if not depth or not folder.is_dir():
        return
    with os.scandir(folder) as entries:
        inside = sorted(entry.name for entry in entries if entry.is_dir())
    found = [name.lower() for name in inside if name.lower() in _SPLITS]
    yield from found
    others = [name for name in inside if name.lower() not in _SPLITS]
    for name in others if len(others) <= _MANY else []:  # a folder of many folders contains recordings, not splits
        yield from _split_folders(folder / name, depth - 1)


def is_of_split(path: Path, root: Path, split: str) -> bool:
    """Whether no folder between ``root`` and ``path`` is named after another split."""
    named = {_SPLITS[part.lower()] for part in path.relative_to(root).parts[:-1] if part.lower() in _SPLITS}
    return named <= {lake_spelling(split)}
