"""Vacuum: snapshots that nobody needs expire, and files that nothing names any more are deleted.

What jobs at work have published but not yet committed is safe for a day; what they take over from earlier jobs they
renew first. Databases, users' columns and results of the simulator are never touched, and the newest snapshot and those
that databases were made on never expire.
"""

from __future__ import annotations

import time
from collections import defaultdict
from collections.abc import Iterable, Mapping
from dataclasses import dataclass

from scenarionet_data.databases import record as databases
from scenarionet_data.errors import BadParameter
from scenarionet_data.execution.progress import Progress
from scenarionet_data.storage.files.lake_files import LakeFiles, Listed
from scenarionet_data.storage.files.opening import LakeLike, open_files
from scenarionet_data.storage.snapshots import manifests
from scenarionet_data.storage.snapshots import snapshot as snapshots

UNCOMMITTED_FOR = 24 * 3600.0
"""How long a file that no snapshot names is left alone [s]: a job at work may be about to commit it."""

_FOLDERS = ("snapshots", "metadata", "tracks", "lights", "maps", "quarantine")


@dataclass(frozen=True)
class Vacuum:
    """What a vacuum does, or did.

    Attributes:
        expired: Numbers of the snapshots that go, rising.
        kept: Numbers of those that stay.
        needed: Databases that keep a snapshot which would go otherwise, by its number.
        files: What goes, in order of name.
        young: Files that nothing names, and that stay because a job may be about to commit them.
        is_done: Whether it was done, or only planned.
    """

    expired: tuple[int, ...]
    kept: tuple[int, ...]
    needed: Mapping[int, tuple[str, ...]]
    files: tuple[Listed, ...]
    young: tuple[Listed, ...]
    is_done: bool = False

    @property
    def size(self) -> int:
        """Bytes of the files that go."""
        return sum(listed.size for listed in self.files)

    @property
    def tables(self) -> dict[str, tuple[int, int]]:
        """Number and bytes of the files that go, by table."""
        found: dict[str, tuple[int, int]] = {}
        for listed in self.files:
            table = listed.name.split("/")[0]
            number, size = found.get(table, (0, 0))
            found[table] = number + 1, size + listed.size
        return found


def plan_vacuum(lake: LakeLike, *, keep_last: int | None = None, older_than: float | None = None) -> Vacuum:
    """What :func:`vacuum` would do; nothing is changed.

    Args:
        lake: The lake, its folder or its URL.
        keep_last: So many of the newest snapshots stay.
        older_than: Younger snapshots stay [s]. With both, a snapshot goes when neither keeps it.

    Raises:
        BadParameter: Neither is given, or one that keeps nothing.
        NoSuchSnapshot: There is no lake.
    """
    if keep_last is None and older_than is None:
        raise BadParameter("say which snapshots may go: keep the last N, or those that are not older than so long")
    if (keep_last is not None and keep_last < 1) or (older_than is not None and older_than < 0):
        raise BadParameter("keep at least the last snapshot: it is what the lake holds")
    files = open_files(lake)
    snapshots.newest(files)
    # Listed before the snapshots are read: whatever a job commits meanwhile is named by one of them, or not listed.
    listed, published = list_files(files), snapshots.published(files)
    numbers = snapshots.numbers(files)
    now = time.time()
    young = {n for n in numbers if older_than is not None and now - published.get(n, now) <= older_than}
    recent = set(numbers[-(keep_last or 1) :])
    bases = _made_on(files)
    going = set(numbers) - young - recent
    needed = {number: tuple(bases[number]) for number in sorted(going & set(bases))}
    expired = going - set(needed)
    named, held_until = _named(files, numbers, {number: published.get(number, 0.0) for number in expired})
    doomed, waiting = _unnamed(listed, named, held_until)
    return Vacuum(tuple(sorted(expired)), tuple(sorted(set(numbers) - expired)), needed, doomed, waiting)


def vacuum(
    lake: LakeLike,
    *,
    keep_last: int | None = None,
    older_than: float | None = None,
    on_progress: Progress | None = None,
) -> Vacuum:
    """Expire snapshots and delete what nothing names; what was done is in the result.

    Killed at any moment it leaves a lake that is whole; the next run deletes what is left, a day later where the
    snapshot that named it has expired already.

    Args:
        lake: The lake, its folder or its URL.
        keep_last: So many of the newest snapshots stay.
        older_than: Younger snapshots stay [s]. With both, a snapshot goes when neither keeps it.
        on_progress: Told about every deleted file.

    Raises:
        BadParameter: Neither is given, or one that keeps nothing.
        NoSuchSnapshot: There is no lake.
        LakeError: The lake cannot be written.
    """
    files = open_files(lake)
    plan = plan_vacuum(lake, keep_last=keep_last, older_than=older_than)
    files.sweep()
    snapshots.sweep_marks(files, UNCOMMITTED_FOR)
    gone = {number: snapshots.read(files, number) for number in plan.expired}
    for number in plan.expired:
        snapshots.expire(files, number)
    # A database may have been made on one meanwhile: that snapshot comes back. A commit may name listed files again.
    for number in sorted(set(gone) & set(_made_on(files))):
        snapshots.restore(files, gone.pop(number))
    names = manifests.NamedFiles(files)
    named = set().union(*(names.of(number) for number in set(snapshots.numbers(files)) - set(plan.kept)))
    deleted = []
    for done, listed in enumerate(plan.files, start=1):
        if listed.name not in named and files.remove_unchanged(listed):
            deleted.append(listed)
        if on_progress:
            on_progress(done, len(plan.files), 0)
    expired = tuple(sorted(gone))
    kept = tuple(number for number in snapshots.numbers(files) if number not in gone)
    return Vacuum(expired, kept, plan.needed, tuple(deleted), plan.young, is_done=True)


def list_files(files: LakeFiles) -> list[Listed]:
    """Files that belong to the lake as long as a snapshot names them."""
    found = (listed for folder in _FOLDERS for listed in files.listing(folder))
    return [listed for listed in found if listed.name.endswith(".parquet")]


def _made_on(files: LakeFiles) -> dict[int, list[str]]:
    """``name@version`` of the databases that were made on each snapshot."""
    found: dict[int, list[str]] = defaultdict(list)
    for name in databases.names(files):
        for version in databases.versions(files, name):
            database = databases.read(files, name, version)
            found[database.lineage.snapshot].append(database.reference)
    return found


def _named(files: LakeFiles, numbers: Iterable[int], expired: Mapping[int, float]) -> tuple[set[str], dict[str, float]]:
    """Files that the snapshots which stay name, and until when the others name each of theirs.

    That is when the last snapshot that names it was published: a file that was published or renewed later may be
    about to be committed again.
    """
    named: set[str] = set()
    held_until: dict[str, float] = {}
    names = manifests.NamedFiles(files)
    for number in numbers:
        found = names.of(number)
        if number in expired:
            held_until |= {name: max(expired[number], held_until.get(name, 0.0)) for name in found}
        else:
            named |= found
    return named, held_until


def _unnamed(
    listed: Iterable[Listed], named: set[str], held_until: Mapping[str, float]
) -> tuple[tuple[Listed, ...], tuple[Listed, ...]]:
    """Files that go, and those that nothing names but that are too young to go."""
    youngest = time.time() - UNCOMMITTED_FOR
    free = sorted((each for each in listed if each.name not in named), key=lambda each: each.name)
    goes = [each.modified < youngest or each.modified <= held_until.get(each.name, -1.0) for each in free]
    going = tuple(each for each, is_going in zip(free, goes, strict=True) if is_going)
    return going, tuple(each for each, is_going in zip(free, goes, strict=True) if not is_going)
