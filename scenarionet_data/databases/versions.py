"""Numbered versions of databases and user columns, one file each; a number is never used twice.

A version that is dropped leaves a mark below ``dropped/``. So ``name@version`` in a lineage means one content, and a
file that comes back, for example from a copy of the lake, is not taken for another one.
"""

from __future__ import annotations

from scenarionet_data.storage.files.lake_files import LakeFiles

_DROPPED = "dropped"


def file(folder: str, number: int) -> str:
    """File of a version.

    Args:
        folder: ``databases/NAME`` or ``layers/NAME``.
        number: From 1.
    """
    return f"{folder}/{number}.parquet"


def numbers(files: LakeFiles, folder: str) -> list[int]:
    """Numbers of the versions in ascending order; empty if there are none."""
    stems = [name.rpartition("/")[2].removesuffix(".parquet") for name in files.names(folder, ".parquet")]
    return sorted(int(stem) for stem in stems if stem.isdecimal())


def dropped(files: LakeFiles, folder: str) -> set[int]:
    """Numbers of the versions that were dropped."""
    return {int(name.rpartition("/")[2]) for name in files.names(f"{_DROPPED}/{folder}")}


def last_used(files: LakeFiles, folder: str) -> int:
    """The highest number of any version, also of those that were dropped; 0 if there was none."""
    return max([0, *numbers(files, folder), *dropped(files, folder)])


def drop(files: LakeFiles, folder: str, number: int | None = None) -> None:
    """Remove all versions, or one."""
    there = numbers(files, folder)
    for each in there if number is None else [number]:
        files.publish_new(f"{_DROPPED}/{folder}/{each}", b"")
    files.remove(folder if number is None or there == [number] else file(folder, number))
