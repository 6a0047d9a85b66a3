"""Snapshots: immutable lists of a lake's files. Readers use a snapshot, never the listing of a folder."""

from __future__ import annotations

import hashlib
import time
from collections.abc import Collection, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from datetime import UTC, datetime

from scenarionet_data.errors import LakeError, NoSuchSnapshot
from scenarionet_data.storage.files.lake_files import LakeFiles
from scenarionet_data.storage.integrity import seals
from scenarionet_data.storage.integrity.seals import NewerFormat

FOLDER = "snapshots"

MANY = 65_536
"""Scenarios from which on a lake stores the order of their ids, and its databases as rows instead of ids."""


@dataclass(frozen=True)
class Snapshot:
    """One version of a lake.

    Attributes:
        number: From 1; 0 is the empty lake before its first commit.
        created_at: UTC, ISO 8601.
        operation: Description of the commit.
        metadata: Files of the metadata table.
        manifests: Parquet files that list the shards.
    """

    number: int
    created_at: str
    operation: str
    metadata: tuple[str, ...]
    manifests: tuple[str, ...]


EMPTY = Snapshot(0, "", "empty", (), ())


def numbers(files: LakeFiles) -> list[int]:
    """Numbers of the existing snapshots, ascending."""
    return files.numbers(FOLDER, ".json")


def read(files: LakeFiles, number: int | None = None) -> Snapshot:
    """Read a snapshot, by default the newest one; EMPTY for a lake without snapshots.

    Raises:
        NoSuchSnapshot: The snapshot does not exist; the message lists those that do.
    """
    there, wanted = files.numbers(FOLDER, ".json"), number
    if number is None:
        if not there:
            return EMPTY
        number = there[-1]
    if number not in there:
        if not there:
            check_is_lake(files)
        found = f"there are {there[0]} ... {there[-1]}" if there else "there are none"
        expired = ", those before have expired" if there and number < there[-1] else ""
        raise NoSuchSnapshot(f"{files.root}: no snapshot {number}; {found}{expired}")
    try:
        return parse(files, number)[0]
    except (FileNotFoundError, LakeError):
        if files.has(file_name(number)):
            raise
        return read(files, wanted)  # expired since it was listed


def read_all(files: LakeFiles, known: Collection[int] = ()) -> dict[int, Snapshot]:
    """Read all snapshots except known ones, by number; one that expires in the meantime is left out.

    Raises:
        LakeError: A snapshot is damaged.
    """
    found = {}
    for number in (number for number in numbers(files) if number not in known):
        try:
            found[number] = parse(files, number)[0]
        except LakeError:
            if files.has(file_name(number)):
                raise
    return found


def newest(files: LakeFiles) -> Snapshot:
    """Read the newest snapshot.

    Raises:
        NoSuchSnapshot: The folder contains no lake.
    """
    check_is_lake(files)
    return read(files)


def check_is_lake(files: LakeFiles) -> None:
    """Raise unless the folder contains a lake.

    Raises:
        NoSuchSnapshot: The message names the remedy.
    """
    if FOLDER not in files.folders("."):
        remedy = f"make one with `scenarionet convert DATASET RAW {files.root}`"
        raise NoSuchSnapshot(f"{files.root}: no lake there; {remedy}")


def parse(files: LakeFiles, number: int) -> tuple[Snapshot, bool]:
    """A snapshot, and whether it is sealed, and therefore verified.

    Raises:
        LakeError: It is damaged, or was written by a newer version of this software.
    """
    name = file_name(number)
    path = files.path(name)
    try:
        content, is_sealed = seals.read_json(files.content(name), files.place(name))
        metadata, manifests = tuple(content.pop("metadata", None) or ()), tuple(content.pop("manifests", None) or ())
        found = Snapshot(metadata=metadata, manifests=manifests, **content)
        if {str} != set(map(type, (found.created_at, found.operation, *metadata, *manifests))):
            raise TypeError("expected texts and lists of texts")
        if found.number != number:
            raise ValueError(f"it is snapshot {found.number}")
        return found, is_sealed
    except NewerFormat as error:
        raise NoSuchSnapshot(f"{path}: {error}, by a newer version of this software; update it") from error
    except (ValueError, TypeError, KeyError) as error:
        raise LakeError(
            f"{path}: damaged, it is no snapshot ({error}); restore it from a copy of the lake, or remove it to go "
            "back to the snapshot before (shards committed since are adopted when their recordings are converted again)"
        ) from error


def publish(files: LakeFiles, snapshot: Snapshot) -> bool:
    """Publish a snapshot unless its number is taken; returns whether it was published."""
    if not _write(files, snapshot):
        return False
    if files.has(file_name(snapshot.number, ".expired")):  # the number was used by a snapshot that has expired
        files.remove(file_name(snapshot.number))
        return False
    return True


def expire(files: LakeFiles, number: int) -> None:
    """Remove a snapshot; a mark keeps its number reserved, so that no concurrent job publishes it again."""
    files.publish_new(file_name(number, ".expired"), b"")
    files.remove(file_name(number))


def restore(files: LakeFiles, snapshot: Snapshot) -> None:
    """Undo :func:`expire`."""
    _write(files, snapshot)
    files.remove(file_name(snapshot.number, ".expired"))


def _write(files: LakeFiles, snapshot: Snapshot) -> bool:
    """Publish the file of a snapshot unless it exists; returns whether it was published."""
    name = file_name(snapshot.number)
    return files.publish_new(name, seals.seal_json(vars(snapshot), files.place_to_write(name)))


def remove_expired(files: LakeFiles, name: str) -> None:
    """Remove the file of a snapshot that was published again after it had expired."""
    mark = name.removesuffix(".json") + ".expired"
    if name.startswith(f"{FOLDER}/") and name.endswith(".json") and files.has(mark):
        files.remove(name)


def sweep_marks(files: LakeFiles, older_than: float) -> None:
    """Remove the marks of snapshots that expired more than ``older_than`` seconds ago."""
    for listed in files.listing(FOLDER):
        if listed.name.endswith(".expired") and time.time() - listed.modified > older_than:
            files.remove_unchanged(listed)


def published(files: LakeFiles) -> dict[int, float]:
    """Time of publication of each snapshot [s since 1970, on the clock of the lake's disk], by number."""
    there = {file_name(number): number for number in numbers(files)}
    return {there[listed.name]: listed.modified for listed in files.listing(FOLDER) if listed.name in there}


def has(files: LakeFiles, snapshot: Snapshot) -> bool:
    """Whether a snapshot still exists."""
    return snapshot.number == 0 or files.has(file_name(snapshot.number))


@contextmanager
def reading_from(files: LakeFiles, snapshot: Snapshot) -> Iterator[None]:
    """Convert errors about missing files into NoSuchSnapshot when the snapshot has expired.

    Raises:
        NoSuchSnapshot: The message names the remedy.
    """
    try:
        yield
    except LakeError as error:
        check_expired(files, snapshot, error)
        raise


def check_expired(files: LakeFiles, snapshot: Snapshot, error: LakeError) -> None:
    """Raise NoSuchSnapshot if an error is due to an expired snapshot; see :func:`reading_from`."""
    if not isinstance(error, NoSuchSnapshot) and not has(files, snapshot):
        raise NoSuchSnapshot(
            f"{files.root}: snapshot {snapshot.number} has expired while it was read (`scenarionet maintain "
            "vacuum`); open the lake again: its newest snapshot holds what has been compacted or replaced since"
        ) from error


def file_name(number: int, suffix: str = ".json") -> str:
    """File name of a snapshot, or of its mark, which ends in ``.expired``."""
    return f"{FOLDER}/{number:08d}{suffix}"


def order_file(metadata: Sequence[str]) -> str:
    """File with the order of the ids in metadata files; lakes without many scenarios have none."""
    return f"{FOLDER}/order-{hashlib.blake2b(chr(10).join(metadata).encode(), digest_size=8).hexdigest()}.parquet"


def now() -> str:
    """Current UTC time in ISO 8601, in seconds."""
    return datetime.now(UTC).isoformat(timespec="seconds")
