"""fsck: check that every file of a lake exists, is intact and matches the references to it.

This checks files; ``quality.checks`` checks the content of scenarios.
"""

from __future__ import annotations

import os
from collections.abc import Iterable, Mapping
from dataclasses import dataclass

import pyarrow as pa
import pyarrow.compute as pc

from scenarionet_data.arrays.dtypes import is_count
from scenarionet_data.errors import BadParameter
from scenarionet_data.execution.progress import Progress
from scenarionet_data.maintenance import content_checks, database_checks, run_checks
from scenarionet_data.maintenance.findings import Findings
from scenarionet_data.maintenance.repair_advice import Inputs, remedy
from scenarionet_data.maintenance.vacuuming import list_files
from scenarionet_data.schema import tables
from scenarionet_data.storage.files.lake_files import IDENTITY, LakeFiles
from scenarionet_data.storage.files.places import LakeFilesLike, open_files
from scenarionet_data.storage.integrity.file_checks import Damage, Written, check_file
from scenarionet_data.storage.integrity.snapshot_checks import Verifier, listed
from scenarionet_data.storage.snapshots import commit as commits
from scenarionet_data.storage.snapshots import manifests, metadata_files
from scenarionet_data.storage.snapshots import snapshot as snapshots
from scenarionet_data.storage.snapshots.snapshot import Snapshot


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
        unsealed: Files of older versions of this software, of which not every byte is verified where it is read;
            :func:`upgrade` seals them.
    """

    snapshots: tuple[int, ...]
    num_files: int
    problems: tuple[Problem, ...]
    notes: tuple[Note, ...]
    unsealed: tuple[str, ...] = ()

    @property
    def is_whole(self) -> bool:
        """Whether there are no problems."""
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
        BadParameter: ``workers`` is no number of threads.
        NoSuchSnapshot: Not a lake.
    """
    if not (workers is None or is_count(workers, 1)):
        raise BadParameter(f"workers: wanted 1 or more, found {workers!r}")
    files = open_files(lake)
    snapshots.check_is_lake(files)
    found = Findings([Damage(name, f"{what}, expected a file") for name, what in files.strange().items()])
    with found.of(IDENTITY):
        files.place(snapshots.file_name(0))
    if IDENTITY in found.broken:  # every seal covers the id
        problems = dict.fromkeys(
            Problem(each.file, _reason(each), remedy(each.file, Inputs([]))) for each in found.damages
        )
        return Fsck((), 0, tuple(problems), ())
    readable: dict[int, Snapshot] = {}
    found.refuse_folders(files, snapshots.FOLDER)
    for number in snapshots.numbers(files):
        name = snapshots.file_name(number)
        with found.of(name):
            readable[number], is_sealed = snapshots.parse(files, number)
            found.saw(name, is_older=not is_sealed)
    manifest_names = sorted({name for snapshot in readable.values() for name in snapshot.manifests})
    lists: dict[str, pa.Table] = {}  # files that each intact manifest lists
    for name in manifest_names:
        with found.of(name):
            if is_deep:
                files.verify(name)
            lists[name] = manifests.read_files(files, name)
            found.saw(name, is_older=not files.end(name).digest)
    together = _together(lists, lists)
    written = listed(together) | dict.fromkeys(pc.unique(together["metadata_file"]).drop_null().to_pylist(), Written())
    merged = dict.fromkeys((name for snapshot in readable.values() for name in snapshot.metadata), Written())
    orders = {snapshots.order_file(snapshot.metadata) for snapshot in readable.values()}
    for name in filter(files.has, sorted(orders)):
        with found.of(name):
            check_file(files, name, Written(), table="id_order", is_deep=is_deep)
    verifier = Verifier(files, is_deep=is_deep, workers=workers or os.cpu_count() or 1)
    found.damages += verifier.files(merged | written, on_progress and (lambda done, total: on_progress(done, total, 0)))
    found.older.update(name for name, intact in verifier.intact.items() if intact.is_older)
    stored = database_checks.read_all(files, readable, found, is_deep=is_deep)
    _check_references(files, readable, {each.lineage.snapshot for each in stored}, verifier, found)
    database_checks.check(files, stored, readable, found)
    run_checks.check(files, found, is_deep=is_deep)
    run_checks.check_moments(files, found, is_deep=is_deep)
    if is_deep and readable:
        with found.of(snapshots.file_name(max(readable))):
            content_checks.check(files, readable[max(readable)], found)
    newest = [name for name in (readable[max(readable)].manifests if readable else ()) if name in lists]
    inputs = Inputs(manifests.read(files, name) for name in (newest if found.damages else ()))
    problems = dict.fromkeys(Problem(each.file, _reason(each), remedy(each.file, inputs)) for each in found.damages)
    named = orders.union(merged, written, lists) if len(lists) == len(manifest_names) else None
    # Data files of the newest snapshot are read in parts.
    current = {name for name in listed(_together(lists, newest)) if name.split("/")[0] in tables.LOADED}
    older = (name for name in found.older if name in current or not written.get(name, Written()).checksum)
    return Fsck(tuple(readable), len(merged | written), tuple(problems), _notes(files, named), tuple(sorted(older)))


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
    for name in filter(files.has, broken):
        if name.startswith(f"{snapshots.FOLDER}/order-"):
            files.remove(name)
    current = manifests.shards(files, snapshots.newest(files))
    hit = [record for record in current if broken.intersection((*record.files, record.metadata_file))]
    commits.commit(files, [], "repair", frozenset(record.key for record in hit))
    commits.consolidate(files)
    for name in sorted(broken.intersection(name for r in hit for name in (*r.files, r.metadata_file) if name)):
        if files.has(name):
            files.remove(name)
    return [record.name for record in hit]


def _check_references(
    files: LakeFiles, readable: dict[int, Snapshot], bases: set[int], verifier: Verifier, found: Findings
) -> None:
    """Check references in the newest snapshot, and in those that databases were made on."""
    broken = found.broken
    for number in sorted({*bases, max(readable, default=0)} & set(readable)):
        if broken.isdisjoint((*readable[number].manifests, *readable[number].metadata)):
            with found.of(snapshots.file_name(number)):
                shards = manifests.shard_table(files, readable[number])
                found.damages += verifier.references(readable[number], shards)


def _together(lists: Mapping[str, pa.Table], names: Iterable[str]) -> pa.Table:
    """Files listed by several manifests."""
    return pa.concat_tables([manifests.NO_FILES, *(lists[name] for name in names)])


def _reason(damage: Damage) -> str:
    """Return the reason without the remedy at the end of an error message."""
    return damage.reason.partition("; ")[0]


def _notes(files: LakeFiles, named: set[str] | None) -> tuple[Note, ...]:
    """Describe unused files.

    Args:
        files: The lake.
        named: Files that snapshots refer to; None if a manifest is damaged.
    """
    unused = [each for each in list_files(files) if each.name not in named] if named is not None else []
    removed = "otherwise `scenarionet maintain vacuum` deletes them"
    text = f"not part of any snapshot: a job may be about to commit them, {removed}"
    temporary = "below .tmp: a job may be writing them, otherwise the next one deletes them after a day"
    kinds = {text: unused, temporary: files.listing(".tmp")}
    return tuple(Note(text, len(found), sum(x.size for x in found)) for text, found in kinds.items() if found)
