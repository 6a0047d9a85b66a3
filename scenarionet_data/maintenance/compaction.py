"""Compaction: many small files become few, in the profile that suits what is done with them.

Whole shards are rewritten together, a bin at a time, beside readers and writers: old snapshots keep their files, and a
bin that another job has changed meanwhile is left out and planned anew. What a killed run has finished is taken as it
is by the next.
"""

from __future__ import annotations

import time
from collections import defaultdict
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from fnmatch import fnmatchcase
from pathlib import Path

from scenarionet_data.conversion.runners import Run, runner
from scenarionet_data.errors import BadParameter, LakeError
from scenarionet_data.store import commit as commits
from scenarionet_data.store import manifests, profiles, rewriting
from scenarionet_data.store import snapshot as snapshots
from scenarionet_data.store.commit import Rewritten
from scenarionet_data.store.files import LakeFiles, open_files
from scenarionet_data.store.profiles import Profile
from scenarionet_data.store.shard_record import ShardRecord

_SCENARIOS_PER_BIN = 1024
_WELL_FILLED = 0.5
"""Files that are filled less are merged with others; those filled more are not worth the work."""
_ROUNDS = 3
_COMMIT_EVERY = 3600.0

_KEYS = ("dataset", "version", "split")


@dataclass(frozen=True)
class Bin:
    """Shards to be written together; picklable.

    Attributes:
        lake: The lake's root.
        profile: Name of the profile.
        records: The shards as they are, of one partition.
    """

    lake: str
    profile: str
    records: tuple[ShardRecord, ...]

    @property
    def num_scenarios(self) -> int:
        """Scenarios of its shards."""
        return sum(record.num_scenarios for record in self.records)


@dataclass(frozen=True)
class Outcome:
    """What became of a bin.

    Attributes:
        bin: Which.
        records: The shards as they are now; empty when it failed.
        error: Why it failed.
    """

    bin: Bin
    records: tuple[ShardRecord, ...]
    error: str | None = None


@dataclass
class Compaction:
    """What a compaction did.

    Attributes:
        profile: Name of the profile.
        shards: Shards that lie in other files now.
        scenarios: Their scenarios.
        files_before, files_after: Files of tracks, lights and maps that hold them.
        bytes_before, bytes_after: Their sizes together.
        failed: Name of a bin's first shard, and why the bin stays as it was.
        left: Shards that other jobs changed again and again meanwhile; the next run takes them.
        snapshot: The lake's newest snapshot.
        seconds: Time it took.
    """

    profile: str
    shards: int = 0
    scenarios: int = 0
    files_before: int = 0
    files_after: int = 0
    bytes_before: int = 0
    bytes_after: int = 0
    failed: list[tuple[str, str]] = field(default_factory=list)
    left: int = 0
    snapshot: int = 0
    seconds: float = 0.0

    def count(self, rewritten: Rewritten) -> None:
        """Add a bin that has been committed."""
        before, after = _sizes(rewritten.old), _sizes(rewritten.new)
        self.shards += len(rewritten.new)
        self.scenarios += sum(record.num_scenarios for record in rewritten.new)
        self.files_before += len(before)
        self.files_after += len(after)
        self.bytes_before += sum(before.values())
        self.bytes_after += sum(after.values())


Progress = Callable[[int, int, int], None]
"""Called with bins done, bins to do, scenarios rewritten."""


def compact(
    lake: str | Path,
    profile: str = "training",
    *,
    where: Mapping[str, str] | None = None,
    workers: int = 1,
    run: Run | None = None,
    on_progress: Progress | None = None,
) -> Compaction:
    """Rewrite a lake's files in a profile, as one new snapshot; ids, content hashes and databases stay as they are.

    Args:
        lake: The lake's folder or URL.
        profile: ``training``: a scenario a row group, up to 64 a file; ``analytics``: 16 a row group, up to 1,024.
        where: Shell patterns for ``dataset``, ``version`` and ``split``; everything unless given.
        workers: Processes.
        run: Does the work in place of the processes, for example on a cluster.
        on_progress: Told about every finished bin.

    Raises:
        BadParameter: There is no such profile, or ``where`` names something else.
        NoSuchSnapshot: There is no lake.
        LakeError: The lake cannot be written.
    """
    started = time.monotonic()
    files, report = open_files(lake), Compaction(profile)
    files.sweep()
    for _ in range(_ROUNDS):
        bins = plan_compaction(lake, profile, where=where)
        late = _rewrite(files, bins, run or runner(min(workers, len(bins))), report, on_progress)
        report.left = sum(len(each.old) for each in late)
        if not late:
            break
    report.snapshot = snapshots.read(files).number
    report.seconds = time.monotonic() - started
    return report


def plan_compaction(
    lake: str | Path, profile: str = "training", *, where: Mapping[str, str] | None = None
) -> list[Bin]:
    """What :func:`compact` would rewrite: bins of up to 1,024 scenarios; a larger shard is a bin of its own.

    Raises:
        BadParameter: There is no such profile, or ``where`` names something else.
        NoSuchSnapshot: There is no lake.
    """
    wanted, patterns, files = profiles.load(profile), dict(where or {}), open_files(lake)
    for key in sorted(set(patterns) - set(_KEYS)):
        raise BadParameter(f"--where {key}: choose by {', '.join(_KEYS)}")
    base = snapshots.newest(files)
    manifests.check_schemas(files, base)
    kinds: dict[tuple[str, ...], list[ShardRecord]] = defaultdict(list)
    for record in manifests.shards(files, base):
        if record.num_scenarios and all(fnmatchcase(getattr(record, key), patterns[key]) for key in patterns):
            # What was converted alike stays told apart from the rest.
            kind = (record.dataset, record.version, record.split, record.converter_version, record.options)
            kinds[kind].append(record)
    found = [bin_ for kind in sorted(kinds) for bin_ in _bins(kinds[kind], wanted)]
    return [Bin(str(files.root), profile, tuple(records)) for records in found]


def compact_bin(job: Bin) -> Outcome:
    """Rewrite one bin, or take what an earlier run has finished; nothing is committed. Runs on a worker."""
    try:
        records = rewriting.rewrite(open_files(job.lake), job.records, profiles.load(job.profile))
    except LakeError as error:  # a damaged file must not keep the others from being compacted
        return Outcome(job, (), str(error))
    return Outcome(job, tuple(records))


def _lost(job: Bin, reason: str) -> Outcome:
    """What becomes of a bin that no worker survives."""
    return Outcome(job, (), reason)


# --- what belongs together --------------------------------------------------------------------------------


def _bins(records: Iterable[ShardRecord], profile: Profile) -> Iterator[list[ShardRecord]]:
    """Shards to write together; those that lie well already are left out."""
    units: dict[str, list[ShardRecord]] = defaultdict(list)
    for record in records:
        units[profiles.unit_of(record)].append(record)
    loose = [unit for unit in units.values() if not _is_well(unit, profile, _WELL_FILLED)]
    for together in _filled(loose):
        is_alone = len(together) == 1
        if not (is_alone and _is_well(together[0], profile, 0.0)):
            yield [record for unit in together for record in unit]


def _is_well(unit: list[ShardRecord], profile: Profile, filled: float) -> bool:
    """Whether shards lie in files of a profile, no more than they need, and filled at least that much."""
    num_files = sum(name.startswith("tracks/") for name in _sizes(unit))
    scenarios = sum(record.num_scenarios for record in unit)
    is_least = num_files <= profile.num_files(scenarios)
    is_filled = scenarios >= filled * num_files * profile.scenarios_per_file
    return profiles.profile_of(unit[0]) == profile and (is_least if not filled else is_filled)


def _filled(units: list[list[ShardRecord]]) -> Iterator[list[list[ShardRecord]]]:
    """Units in order, as many together as make a bin."""
    together: list[list[ShardRecord]] = []
    count = 0
    for unit in units:
        size = sum(record.num_scenarios for record in unit)
        if together and count + size > _SCENARIOS_PER_BIN:
            yield together
            together, count = [], 0
        together.append(unit)
        count += size
    if together:
        yield together


def _sizes(records: Iterable[ShardRecord]) -> dict[str, int]:
    """Size of each file of tracks, lights and maps that some shards lie in."""
    return {
        name: size
        for record in records
        for name, size in zip(record.files, record.sizes, strict=True)
        if name.split("/")[0] in rewriting.TABLES
    }


# --- doing it ---------------------------------------------------------------------------------------------


def _rewrite(
    files: LakeFiles, bins: list[Bin], run: Run, report: Compaction, on_progress: Progress | None
) -> list[Rewritten]:
    """Rewrite bins and commit them; returns those that other jobs have changed meanwhile."""
    late: list[Rewritten] = []
    finished: list[Rewritten] = []
    failed: list[Outcome] = []
    num_scenarios, committed_at = 0, time.monotonic()
    if on_progress:
        on_progress(0, len(bins), 0)
    for done, outcome in enumerate(run(bins, compact_bin, _lost), start=1):
        if outcome.error:
            failed.append(outcome)
        else:
            finished.append(Rewritten(outcome.bin.records, outcome.records))
        num_scenarios += outcome.bin.num_scenarios
        if on_progress:
            on_progress(done, len(bins), num_scenarios)
        if time.monotonic() - committed_at > _COMMIT_EVERY:  # well within the day after which a vacuum takes it
            late += _commit(files, finished, report)
            finished, committed_at = [], time.monotonic()
    late += _commit(files, finished, report)
    return late + _report_failed(files, failed, report)


def _report_failed(files: LakeFiles, failed: list[Outcome], report: Compaction) -> list[Rewritten]:
    """Note why bins failed; returns those whose files are gone because other jobs have changed them meanwhile."""
    report.failed = []
    late = []
    there = {record.key: record for record in manifests.shards(files, snapshots.read(files))} if failed else {}
    for outcome in failed:
        if all(there.get(record.key) == record for record in outcome.bin.records):
            report.failed.append((outcome.bin.records[0].name, str(outcome.error)))
        else:
            late.append(Rewritten(outcome.bin.records, ()))
    return late


def _commit(files: LakeFiles, finished: list[Rewritten], report: Compaction) -> list[Rewritten]:
    if not finished:
        return []
    _, late = commits.swap(files, finished, f"compact for {report.profile}")
    for each in finished:
        if each not in late:
            report.count(each)
    return late
