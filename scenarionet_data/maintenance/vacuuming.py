"""Vacuum: expire old snapshots and delete files that no snapshot refers to.

Files that running jobs have published but not yet committed are kept for a day; files adopted from earlier jobs are
renewed first. Databases, user columns, evaluation results and moments of the newest definitions are never deleted,
and the newest snapshot and those that databases were made on never expire.
"""

from __future__ import annotations

import time
from collections import defaultdict
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from operator import itemgetter

from scenarionet_data.arrays.dtypes import is_count, is_number
from scenarionet_data.databases import record as databases
from scenarionet_data.errors import BadParameter
from scenarionet_data.execution.progress import Progress
from scenarionet_data.storage import kept_moments
from scenarionet_data.storage.files.lake_files import LakeFiles, Listed
from scenarionet_data.storage.files.places import LakeFilesLike, open_files
from scenarionet_data.storage.snapshots import manifests
from scenarionet_data.storage.snapshots import snapshot as snapshots
from scenarionet_data.storage.snapshots.snapshot import Snapshot

UNCOMMITTED_FOR = 24 * 3600.0
"""Minimum age of unreferenced files before deletion [s]: a running job may be about to commit them."""

_FOLDERS = ("snapshots", "metadata", "tracks", "lights", "maps", "quarantine", "defects")


@dataclass(frozen=True)
class Vacuum:
    """Plan or result of a vacuum.

    Attributes:
        expired: Numbers of the expired snapshots, ascending.
        kept: Numbers of the others.
        needed: Databases that prevent a snapshot from expiring, by its number.
        files: Deleted files, sorted by name.
        young: Unreferenced files kept because a job may be about to commit them.
        is_done: Whether it was carried out.
    """

    expired: tuple[int, ...]
    kept: tuple[int, ...]
    needed: Mapping[int, tuple[str, ...]]
    files: tuple[Listed, ...]
    young: tuple[Listed, ...]
    is_done: bool = False

    @property
    def size(self) -> int:
        """Total size of the deleted files [bytes]."""
        return sum(listed.size for listed in self.files)

    @property
    def tables(self) -> dict[str, tuple[int, int]]:
        """Number and size of the deleted files, by table."""
        found: dict[str, tuple[int, int]] = {}
        for listed in self.files:
            table = listed.name.split("/")[0]
            number, size = found.get(table, (0, 0))
            found[table] = number + 1, size + listed.size
        return found


def plan_vacuum(lake: LakeFilesLike, *, keep_last: int | None = None, older_than: float | None = None) -> Vacuum:
    """Return what :func:`vacuum` would do, without changing anything.

    Args:
        lake: The lake, its folder or its URL.
        keep_last: Number of newest snapshots to keep.
        older_than: Keep snapshots younger than this [s]. With both, a snapshot expires if neither keeps it.

    Raises:
        BadParameter: Neither is given, or nothing would be kept.
        NoSuchSnapshot: Not a lake.
    """
    return _plan(open_files(lake), keep_last, older_than)[0]


def _plan(files: LakeFiles, keep_last: int | None, older_than: float | None) -> tuple[Vacuum, dict[int, Snapshot]]:
    """The plan, and the existing snapshots."""
    if keep_last is None and older_than is None:
        raise BadParameter("give keep_last or older_than: the number of newest snapshots to keep, or their maximum age")
    if not (keep_last is None or is_count(keep_last, 1)):
        raise BadParameter(f"keep_last={keep_last!r}; keep at least the newest snapshot, the content of the lake")
    if not (older_than is None or (is_number(older_than) and older_than >= 0)):
        raise BadParameter(f"older_than={older_than!r}; expected a time of 0 s or more")
    snapshots.newest(files)
    # List files before reading snapshots: a file committed in between is either referenced or not listed.
    listed, published = list_files(files), snapshots.published(files)
    existing = snapshots.read_all(files)
    numbers = sorted(existing)
    now = time.time()
    young = {n for n in numbers if older_than is not None and now - published.get(n, now) <= older_than}
    recent = set(numbers[-(keep_last or 1) :])
    used = _made_on(files)
    going = set(numbers) - young - recent
    needed = {number: tuple(used[number]) for number in sorted(going & set(used))}
    expired = going - set(needed)
    named, held_until = _named(files, existing, {number: published.get(number, 0.0) for number in expired})
    deleted, waiting = _unnamed(listed, named, held_until)
    plan = Vacuum(tuple(sorted(expired)), tuple(sorted(set(numbers) - expired)), needed, deleted, waiting)
    return plan, existing


def vacuum(
    lake: LakeFilesLike,
    *,
    keep_last: int | None = None,
    older_than: float | None = None,
    on_progress: Progress | None = None,
) -> Vacuum:
    """Expire snapshots and delete unreferenced files.

    The lake stays consistent if the process is killed at any moment; the next run deletes the rest, a day later if the
    snapshot of a file has already expired.

    Args:
        lake: The lake, its folder or its URL.
        keep_last: Number of newest snapshots to keep.
        older_than: Keep snapshots younger than this [s]. With both, a snapshot expires if neither keeps it.
        on_progress: Called after each file.

    Raises:
        BadParameter: Neither is given, or nothing would be kept.
        NoSuchSnapshot: Not a lake.
        LakeError: The lake cannot be written.
    """
    files = open_files(lake)
    plan, existing = _plan(files, keep_last, older_than)
    files.sweep()
    snapshots.sweep_marks(files, UNCOMMITTED_FOR)
    removed = {number: existing[number] for number in plan.expired}
    for number in plan.expired:
        snapshots.expire(files, number)
    # Restore a snapshot that a database was made on in the meantime. A commit may refer to listed files again.
    for number in sorted(set(removed) & set(_made_on(files))):
        snapshots.restore(files, removed.pop(number))
    named = manifests.NamedFiles(files).of(snapshots.read_all(files, known=set(plan.kept)).values())
    deleted = []
    for done, listed in enumerate(plan.files, start=1):
        if listed.name not in named and files.remove_unchanged(listed):
            deleted.append(listed)
        if on_progress:
            on_progress(done, len(plan.files), 0)
    expired = tuple(sorted(removed))
    kept = tuple(number for number in snapshots.numbers(files) if number not in removed)
    return Vacuum(expired, kept, plan.needed, tuple(deleted), plan.young, is_done=True)


def list_files(files: LakeFiles) -> list[Listed]:
    """List the files that belong to snapshots, and those of moments that a newer definition has replaced."""
    found = (listed for folder in _FOLDERS for listed in files.listing(folder))
    return [*(listed for listed in found if listed.name.endswith(".parquet")), *kept_moments.superseded(files)]


def _made_on(files: LakeFiles) -> dict[int, list[str]]:
    """``name@version`` of the databases that were made on each snapshot."""
    found: dict[int, list[str]] = defaultdict(list)
    for database in databases.all_records(files):
        found[database.lineage.snapshot].append(database.reference)
    return found


def _named(
    files: LakeFiles, existing: Mapping[int, Snapshot], expired: Mapping[int, float]
) -> tuple[set[str], dict[str, float]]:
    """Return the files of the kept snapshots, and for files of expired ones when the last of these was published.

    A file that was published or renewed later than that may be about to be committed again. Snapshots share most of
    their manifests, so the files of each manifest are visited once.
    """
    names = manifests.NamedFiles(files)
    named = names.of(snapshot for number, snapshot in existing.items() if number not in expired)
    lists_until: dict[str, float] = {}
    held: list[tuple[float, Iterable[str]]] = []
    for number, published in expired.items():
        for name in existing[number].manifests:
            lists_until[name] = max(published, lists_until.get(name, 0.0))
        held.append((published, existing[number].metadata))
    held += ((published, (manifest, *names.listed(manifest))) for manifest, published in lists_until.items())
    held_until: dict[str, float] = {}
    for published, of in sorted(held, key=itemgetter(0)):
        held_until.update(dict.fromkeys(of, published))
    return named, held_until


def _unnamed(
    listed: Iterable[Listed], named: set[str], held_until: Mapping[str, float]
) -> tuple[tuple[Listed, ...], tuple[Listed, ...]]:
    """Split unreferenced files into those to delete and those too young for it."""
    youngest = time.time() - UNCOMMITTED_FOR
    free = sorted((each for each in listed if each.name not in named), key=lambda each: each.name)
    goes = [each.modified < youngest or each.modified <= held_until.get(each.name, -1.0) for each in free]
    going = tuple(each for each, is_going in zip(free, goes, strict=True) if is_going)
    return going, tuple(each for each, is_going in zip(free, goes, strict=True) if not is_going)
