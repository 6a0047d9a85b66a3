"""Snapshots: the committed, immutable lists of what a lake holds. Readers trust a snapshot, never a folder."""

from __future__ import annotations

import json
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import asdict, dataclass
from datetime import UTC, datetime
from pathlib import Path

from scenarionet_data.errors import LakeError, NoSuchSnapshot
from scenarionet_data.storage.files.lake_files import LakeFiles

FOLDER = "snapshots"


@dataclass(frozen=True)
class Snapshot:
    """One version of a lake.

    Attributes:
        number: From 1; 0 is the empty lake before its first commit.
        created_at: UTC, ISO 8601.
        operation: What made it, in words.
        metadata: Live files of the metadata table.
        manifests: Parquet files that list the shards, together.
    """

    number: int
    created_at: str
    operation: str
    metadata: tuple[str, ...]
    manifests: tuple[str, ...]

    def to_bytes(self) -> bytes:
        """As JSON text."""
        return json.dumps({"format": 1, **asdict(self)}, indent=1).encode()


EMPTY = Snapshot(0, "", "empty", (), ())


def numbers(files: LakeFiles) -> list[int]:
    """Numbers of the snapshots that are there, rising."""
    stems = [name.rpartition("/")[2].removesuffix(".json") for name in files.names(FOLDER, ".json")]
    return sorted(int(stem) for stem in stems if stem.isdecimal())


def read(files: LakeFiles, number: int | None = None) -> Snapshot:
    """A snapshot; the newest when no number is given, EMPTY for a lake without any.

    Raises:
        NoSuchSnapshot: That number is not there; the message lists what is.
    """
    there, wanted = numbers(files), number
    if number is None:
        if not there:
            return EMPTY
        number = there[-1]
    if number not in there:
        found = f"there are {there[0]} ... {there[-1]}" if there else "there are none"
        expired = ", those before have expired" if there and number < there[-1] else ""
        raise NoSuchSnapshot(f"{files.root}: no snapshot {number}; {found}{expired}")
    try:
        return _parse(files.path(file_name(number)))
    except (FileNotFoundError, LakeError):
        if files.has(file_name(number)):
            raise
        return read(files, wanted)  # it has expired since it was listed


def newest(files: LakeFiles) -> Snapshot:
    """The newest snapshot.

    Raises:
        NoSuchSnapshot: There is no lake.
    """
    check_is_lake(files)
    return read(files)


def check_is_lake(files: LakeFiles) -> None:
    """Refuse a folder that is none.

    Raises:
        NoSuchSnapshot: With the remedy.
    """
    if FOLDER not in files.folders("."):
        remedy = f"make one with `scenarionet convert DATASET RAW {files.root}`"
        raise NoSuchSnapshot(f"{files.root}: no lake there; {remedy}")


def _parse(path: Path) -> Snapshot:
    try:
        content = json.loads(path.read_bytes())
        if content.pop("format") != 1:
            raise NoSuchSnapshot(f"{path}: written by a newer version of this software; update it")
        content["metadata"], content["manifests"] = tuple(content["metadata"]), tuple(content["manifests"])
        return Snapshot(**content)
    except (ValueError, TypeError, KeyError, AttributeError) as error:
        raise LakeError(
            f"{path}: damaged, it is no snapshot; restore it from a copy of the lake, or remove it to go back to the "
            "snapshot before (what was committed since is adopted when its recordings are converted again)"
        ) from error


def publish(files: LakeFiles, snapshot: Snapshot) -> bool:
    """Publish a snapshot unless another job took its number; returns whether it did."""
    if not files.publish_new(file_name(snapshot.number), snapshot.to_bytes()):
        return False
    if files.has(_mark(snapshot.number)):  # that number was taken and has expired since: others have moved on
        files.remove(file_name(snapshot.number))
        return False
    return True


def expire(files: LakeFiles, number: int) -> None:
    """Take a snapshot away. Its number stays taken: a mark says so to whoever was about to publish it."""
    files.publish_new(_mark(number), b"")
    files.remove(file_name(number))


def restore(files: LakeFiles, snapshot: Snapshot) -> None:
    """Undo :func:`expire`."""
    files.publish_new(file_name(snapshot.number), snapshot.to_bytes())
    files.remove(_mark(snapshot.number))


def sweep_marks(files: LakeFiles, older_than: float) -> None:
    """Let numbers of snapshots that expired more than some seconds ago go: nobody is about to publish them."""
    for listed in files.listing(FOLDER):
        if listed.name.endswith(".expired") and time.time() - listed.modified > older_than:
            files.remove_unchanged(listed)


def published(files: LakeFiles) -> dict[int, float]:
    """When each snapshot was published [s since 1970, on the clock of the lake's disk], by number."""
    there = {file_name(number): number for number in numbers(files)}
    return {there[listed.name]: listed.modified for listed in files.listing(FOLDER) if listed.name in there}


def has(files: LakeFiles, snapshot: Snapshot) -> bool:
    """Whether a snapshot that was read is still there."""
    return snapshot.number == 0 or files.has(file_name(snapshot.number))


@contextmanager
def reading_from(files: LakeFiles, snapshot: Snapshot) -> Iterator[None]:
    """Says of a file that is gone that its snapshot has expired, where that is so.

    Raises:
        NoSuchSnapshot: With the remedy.
    """
    try:
        yield
    except LakeError as error:
        if isinstance(error, NoSuchSnapshot) or has(files, snapshot):
            raise
        raise NoSuchSnapshot(
            f"{files.root}: snapshot {snapshot.number} has expired while it was read (`scenarionet vacuum`); open the "
            "lake again: its newest snapshot holds what has been compacted or replaced since"
        ) from error


def file_name(number: int) -> str:
    """Name of a snapshot's file."""
    return f"{FOLDER}/{number:08d}.json"


def _mark(number: int) -> str:
    return f"{FOLDER}/{number:08d}.expired"


def now() -> str:
    """UTC in ISO 8601, to the second."""
    return datetime.now(UTC).isoformat(timespec="seconds")
