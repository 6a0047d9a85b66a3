"""fsck: check that every file of a lake exists, is intact and matches the references to it.

This checks files; ``quality.checks`` checks the content of scenarios.
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
from scenarionet_data.storage.files.opening import LakeFilesLike, open_files
from scenarionet_data.storage.snapshots import commit as commits
from scenarionet_data.storage.snapshots import manifests, metadata_files
from scenarionet_data.storage.snapshots import snapshot as snapshots
from scenarionet_data.storage.snapshots.snapshot import Snapshot
from scenarionet_data.storage.verifying import Damage, Verifier, Written, listed, unreadable


@dataclass(frozen=True)
class Problem:
    """A problem with a file.

    Attributes:
        file: Its name, relative to the lake.
        reason: What was expected and what was found.
        remedy: How to fix it.
    """

    file: str
    reason: str
    remedy: str


@dataclass(frozen=True)
class Note:
    """Files that are not damaged, but unused.

    Attributes:
        text: Description.
        num_files: Number of files.
        size: Total size [bytes].
    """

    text: str
    num_files: int
    size: int


@dataclass(frozen=True)
class Fsck:
    """Result of a check.

    Attributes:
        snapshots: Numbers of the readable snapshots.
        num_files: Number of checked table files.
        problems: Damaged or missing files.
        notes: Unused files.
    """

    snapshots: tuple[int, ...]
    num_files: int
    problems: tuple[Problem, ...]
    notes: tuple[Note, ...]

    @property
    def is_whole(self) -> bool:
        """Whether readable are no problems."""
        return not self.problems


def fsck(
    lake: LakeFilesLike, *, is_deep: bool = False, workers: int | None = None, on_progress: Progress | None = None
) -> Fsck:
    """Check the files of a lake without changing anything.

    Every file of a snapshot has to exist with the recorded size, footer and number of rows. In the newest snapshot, and
    in those that databases were made on, every reference is checked.

    Args:
        lake: The lake, its folder or its URL.
        is_deep: Read every byte: verify checksums and the scenario of every row.
        workers: Number of threads; one per core by default.
        on_progress: Called after each table file.

    Raises:
        NoSuchSnapshot: Not a lake.
    """
    files = open_files(lake)
    snapshots.check_is_lake(files)
    readable, damages = _read_snapshots(files)
    lists, found = _read_manifests(files, readable)
    damages += found
    written = _written(lists.values())
    damages += (each for name in _current_metadata(readable) for each in unreadable(files, name))
    verifier = Verifier(files, is_deep=is_deep, workers=workers or os.cpu_count() or 1)
    damaged = {damage.file for damage in damages}
    read = {name: known for name, known in written.items() if name not in damaged}
    damages += verifier.files(read, on_progress and (lambda done, total: on_progress(done, total, 0)))
    broken = {damage.file for damage in damages}
    for number in sorted({*database_checks.bases(files), max(readable, default=0)} & set(readable)):
        if broken.isdisjoint((*readable[number].manifests, *readable[number].metadata)):
            damages += verifier.references(readable[number], manifests.shard_table(files, readable[number]))
    damages += database_checks.damages(files, readable, broken)
    newest = readable[max(readable)].manifests if readable else ()
    inputs = Inputs(lists[name] for name in newest if name in lists)
    problems = dict.fromkeys(Problem(each.file, _reason(each), remedy(each.file, inputs)) for each in damages)
    return Fsck(tuple(readable), len(written), tuple(problems), _notes(files, readable))


def repair(lake: LakeFilesLike, found: Fsck) -> list[str]:
    """Remove shards with damaged files from the lake, so that they can be converted again.

    Merged metadata is merged again. Damaged files of shards are deleted.

    Args:
        lake: The lake, its folder or its URL.
        found: Result of :func:`fsck`.

    Returns:
        Names of the shards to convert again.
    """
    files = open_files(lake)
    broken = {problem.file for problem in found.problems}
    metadata_files.merge_again(files, broken)
    current = manifests.shards(files, snapshots.newest(files))
    hit = [record for record in current if broken.intersection((*record.files, record.metadata_file))]
    commits.commit(files, [], "repair", frozenset(record.key for record in hit))
    commits.consolidate(files)
    for name in sorted(broken.intersection(name for r in hit for name in (*r.files, r.metadata_file) if name)):
        if files.has(name):
            files.remove(name)
    return [record.name for record in hit]


def _read_snapshots(files: LakeFiles) -> tuple[dict[int, Snapshot], list[Damage]]:
    """Read all snapshots; return the readable ones, and the damage of the others."""
    readable, damages = {}, []
    for number in snapshots.numbers(files):
        try:
            readable[number] = snapshots.read(files, number)
        except LakeError as error:
            damages.append(Damage(snapshots.file_name(number), str(error)))
    return readable, damages


def _read_manifests(files: LakeFiles, readable: dict[int, Snapshot]) -> tuple[dict[str, pa.Table], list[Damage]]:
    """Read all manifests; return the shards of each, and the damage of unreadable ones."""
    names = sorted({name for snapshot in readable.values() for name in snapshot.manifests})
    damages = {name: list(unreadable(files, name)) for name in names}
    lists = {name: manifests.read(files, name) for name in names if not damages[name]}
    return lists, [damage for found in damages.values() for damage in found]


def _written(lists: Iterable[pa.Table]) -> dict[str, Written]:
    """Recorded properties of every file of a shard."""
    written: dict[str, Written] = {}
    for shards in lists:
        written |= listed(shards)
        written |= dict.fromkeys(shards["metadata_file"].drop_null().to_pylist(), Written())
    return written


def _reason(damage: Damage) -> str:
    """Return the reason without the remedy at the end of an error message."""
    return damage.reason.partition("; ")[0]


def _current_metadata(readable: dict[int, Snapshot]) -> list[str]:
    return sorted({name for snapshot in readable.values() for name in snapshot.metadata})


def _notes(files: LakeFiles, readable: dict[int, Snapshot]) -> tuple[Note, ...]:
    names = manifests.NamedFiles(files)
    try:
        named = set().union(*(names.of(number) for number in readable))
    except LakeError:  # reported already; unused files cannot be determined
        return ()
    kinds = {
        "not part of any snapshot: a job may be about to commit them, otherwise `scenarionet vacuum` deletes them": [
            each for each in list_files(files) if each.name not in named
        ],
        "below .tmp: a job may be writing them, otherwise the next one deletes them after a day": files.listing(".tmp"),
    }
    return tuple(Note(text, len(found), sum(x.size for x in found)) for text, found in kinds.items() if found)
