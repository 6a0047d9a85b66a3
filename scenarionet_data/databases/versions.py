"""Numbered versions of databases and user columns, one file each; a number is never used twice.

A version that is dropped leaves a mark below ``dropped/``. So ``name@version`` in a lineage means one content, and a
file that comes back, for example from a copy of the lake, is not taken for another one.
"""

from __future__ import annotations

from scenarionet_data.storage.files.lake_files import LakeFiles

DROPPED = "dropped/"


def numbers(kind: str, files: LakeFiles, name: str, suffix: str = ".parquet") -> list[int]:
    """Return the versions in ascending order; empty if there are none.

    Args:
        kind: ``databases`` or ``layers``; behind DROPPED, versions that were dropped.
        files: The lake.
        name: The database, or the user column.
        suffix: Of the files.
    """
    return files.numbers(f"{kind}/{name}", suffix)


def following(kind: str, files: LakeFiles, name: str) -> int:
    """Return the number of the next version, which none had before, not even one that was dropped."""
    return 1 + max([0, *numbers(kind, files, name), *numbers(DROPPED + kind, files, name, "")])


def drop(kind: str, files: LakeFiles, name: str, version: int | None = None) -> None:
    """Remove all versions, or one."""
    there = numbers(kind, files, name)
    for number in there if version is None else [version]:
        files.publish_new(f"{DROPPED}{kind}/{name}/{number}", b"")
    files.remove(f"{kind}/{name}" if version is None or there == [version] else f"{kind}/{name}/{version}.parquet")
