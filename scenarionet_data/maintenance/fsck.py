"""fsck: whether every file of a lake is there, whole, and what others that refer to it say it is.

Files only: whether what scenarios say makes sense is asked by ``catalog.checks``.
"""

from __future__ import annotations

import os
from collections.abc import Iterable
from dataclasses import dataclass

import pyarrow as pa

from scenarionet_data.errors import LakeError
from scenarionet_data.execution.progress import Progress
from scenarionet_data.maintenance import database_checks
from scenarionet_data.maintenance.repair_advice import Inputs, remedy
from scenarionet_data.maintenance.vacuuming import list_files
from scenarionet_data.storage.files.lake_files import LakeFiles
from scenarionet_data.storage.files.opening import LakeLike, open_files
from scenarionet_data.storage.snapshots import commit as commits
from scenarionet_data.storage.snapshots import manifests, metadata_files
from scenarionet_data.storage.snapshots import snapshot as snapshots
from scenarionet_data.storage.snapshots.snapshot import Snapshot
from scenarionet_data.storage.verifying import Damage, Verifier, Written, listed, unreadable


@dataclass(frozen=True)
class Problem:
    """Something wrong with a file.

    Attributes:
        file: Its name, relative to the lake.
        reason: What was wanted and what was found.
        remedy: What to do.
    """

    file: str
    reason: str
    remedy: str


@dataclass(frozen=True)
class Note:
    """Files that are not wrong, but only take room.

    Attributes:
        text: What they are.
        num_files: How many.
        size: Bytes.
    """

    text: str
    num_files: int
    size: int


@dataclass(frozen=True)
class Fsck:
    """What was found.

    Attributes:
        snapshots: Numbers of the snapshots that can be read.
        num_files: Files of tables that were checked.
        problems: What is wrong.
        notes: What only takes room.
    """

    snapshots: tuple[int, ...]
    num_files: int
    problems: tuple[Problem, ...]
    notes: tuple[Note, ...]

    @property
    def is_whole(self) -> bool:
        """Whether nothing is wrong."""
        return not self.problems


def fsck(
    lake: LakeLike, *, is_deep: bool = False, workers: int | None = None, on_progress: Progress | None = None
) -> Fsck:
    """Check the files of a lake; nothing is changed.

    Every file that a snapshot names has to be there, with its size, footer and rows. In the newest snapshot, and in
    those that databases were made on, every reference is followed.

    Args:
        lake: The lake, its folder or its URL.
        is_deep: Read every byte: checksums, and who lies in every row.
        workers: Threads; one a core unless given.
        on_progress: Told about every file of a table.

    Raises:
        NoSuchSnapshot: There is no lake.
    """
    files = open_files(lake)
    snapshots.check_is_lake(files)
    there, damages = _read_snapshots(files)
    lists, found = _read_manifests(files, there)
    damages += found
    written = _written(lists.values())
    damages += (each for name in _live_metadata(there) for each in unreadable(files, name))
    verifier = Verifier(files, is_deep=is_deep, workers=workers or os.cpu_count() or 1)
    told = {damage.file for damage in damages}
    read = {name: known for name, known in written.items() if name not in told}
    damages += verifier.files(read, on_progress and (lambda done, total: on_progress(done, total, 0)))
    broken = {damage.file for damage in damages}
    for number in sorted({*database_checks.bases(files), max(there, default=0)} & set(there)):
        if broken.isdisjoint((*there[number].manifests, *there[number].metadata)):
            damages += verifier.references(there[number], manifests.shard_table(files, there[number]))
    damages += database_checks.damages(files, there, broken)
    newest = there[max(there)].manifests if there else ()
    inputs = Inputs(lists[name] for name in newest if name in lists)
    problems = dict.fromkeys(Problem(each.file, _reason(each), remedy(each.file, inputs)) for each in damages)
    return Fsck(tuple(there), len(written), tuple(problems), _notes(files, there))


def repair(lake: LakeLike, found: Fsck) -> list[str]:
    """Take shards with damaged files out of the lake, so that converting again brings them back.

    Merged metadata is merged again. Damaged files of shards are deleted: nothing would ever read them.

    Args:
        lake: The lake, its folder or its URL.
        found: What is wrong with it.

    Returns:
        Names of the shards that have to be converted again.
    """
    files = open_files(lake)
    broken = {problem.file for problem in found.problems}
    metadata_files.merge_again(files, broken)
    held = manifests.shards(files, snapshots.newest(files))
    hit = [record for record in held if broken.intersection((*record.files, record.metadata_file))]
    commits.commit(files, [], "repair", frozenset(record.key for record in hit))
    commits.consolidate(files)
    for name in sorted(broken.intersection(name for r in hit for name in (*r.files, r.metadata_file) if name)):
        if files.has(name):
            files.remove(name)
    return [record.name for record in hit]


def _read_snapshots(files: LakeFiles) -> tuple[dict[int, Snapshot], list[Damage]]:
    """The snapshots that can be read, and what is wrong with the others."""
    there, damages = {}, []
    for number in snapshots.numbers(files):
        try:
            there[number] = snapshots.read(files, number)
        except LakeError as error:
            damages.append(Damage(snapshots.file_name(number), str(error)))
    return there, damages


def _read_manifests(files: LakeFiles, there: dict[int, Snapshot]) -> tuple[dict[str, pa.Table], list[Damage]]:
    """The shards that each manifest lists, and what is wrong with those that cannot be read."""
    names = sorted({name for snapshot in there.values() for name in snapshot.manifests})
    damages = {name: list(unreadable(files, name)) for name in names}
    lists = {name: manifests.read(files, name) for name in names if not damages[name]}
    return lists, [damage for found in damages.values() for damage in found]


def _written(lists: Iterable[pa.Table]) -> dict[str, Written]:
    """What is known about every file that belongs to a shard."""
    written: dict[str, Written] = {}
    for shards in lists:
        written |= listed(shards)
        written |= dict.fromkeys(shards["metadata_file"].drop_null().to_pylist(), Written())
    return written


def _reason(damage: Damage) -> str:
    """What was found, without the remedy that an error's message ends with."""
    return damage.reason.partition("; ")[0]


def _live_metadata(there: dict[int, Snapshot]) -> list[str]:
    return sorted({name for snapshot in there.values() for name in snapshot.metadata})


def _notes(files: LakeFiles, there: dict[int, Snapshot]) -> tuple[Note, ...]:
    names = manifests.NamedFiles(files)
    try:
        named = set().union(*(names.of(number) for number in there))
    except LakeError:  # told already; what belongs to nobody cannot be told then
        return ()
    kinds = {
        "named by no snapshot: a job may be about to commit them, else `scenarionet vacuum` deletes them": [
            each for each in list_files(files) if each.name not in named
        ],
        "below .tmp: a job may be writing them, else the next one deletes them after a day": files.listing(".tmp"),
    }
    return tuple(Note(text, len(found), sum(x.size for x in found)) for text, found in kinds.items() if found)
