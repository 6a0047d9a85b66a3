"""Compaction: many small files become few, in the profile that suits what is done with them.

Whole shards are rewritten together, a bin at a time, beside readers and writers: old snapshots keep their files, and a
bin that another job has changed meanwhile is left out and planned anew. What a killed run has finished is taken as it
is by the next.
"""

from __future__ import annotations

import time
from collections.abc import Mapping
from dataclasses import dataclass, field

from scenarionet_data.errors import LakeError
from scenarionet_data.execution.executors import Executor, executor_for
from scenarionet_data.execution.progress import Progress
from scenarionet_data.maintenance.bin_packing import Bin, content_sizes, plan_compaction
from scenarionet_data.storage.files.lake_files import LakeFiles
from scenarionet_data.storage.files.opening import LakeLike, open_files
from scenarionet_data.storage.snapshots import commit as commits
from scenarionet_data.storage.snapshots import manifests
from scenarionet_data.storage.snapshots import snapshot as snapshots
from scenarionet_data.storage.snapshots.commit import Rewritten
from scenarionet_data.storage.snapshots.shard_record import ShardRecord
from scenarionet_data.storage.write import layouts, rewriting

_ROUNDS = 3
_COMMIT_EVERY = 3600.0


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
        before, after = content_sizes(rewritten.old), content_sizes(rewritten.new)
        self.shards += len(rewritten.new)
        self.scenarios += sum(record.num_scenarios for record in rewritten.new)
        self.files_before += len(before)
        self.files_after += len(after)
        self.bytes_before += sum(before.values())
        self.bytes_after += sum(after.values())


def compact(
    lake: LakeLike,
    profile: str = "training",
    *,
    where: Mapping[str, str] | None = None,
    workers: int = 1,
    executor: Executor | None = None,
    on_progress: Progress | None = None,
) -> Compaction:
    """Rewrite a lake's files in a profile, as one new snapshot; ids, content hashes and databases stay as they are.

    Args:
        lake: The lake, its folder or its URL.
        profile: ``training``: a scenario a row group, up to 64 a file; ``analytics``: 16 a row group, up to 1,024.
        where: Shell patterns for ``dataset``, ``version`` and ``split``; everything unless given.
        workers: Processes.
        executor: Does the work in place of the processes, for example on a cluster.
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
        late = _rewrite(files, bins, executor or executor_for(min(workers, len(bins))), report, on_progress)
        report.left = sum(len(each.old) for each in late)
        if not late:
            break
    report.snapshot = snapshots.read(files).number
    report.seconds = time.monotonic() - started
    return report


def compact_bin(job: Bin) -> Outcome:
    """Rewrite one bin, or take what an earlier run has finished; nothing is committed. Runs on a worker."""
    try:
        records = rewriting.rewrite(open_files(job.lake), job.records, layouts.load(job.profile))
    except LakeError as error:  # a damaged file must not keep the others from being compacted
        return Outcome(job, (), str(error))
    return Outcome(job, tuple(records))


def _lost(job: Bin, reason: str) -> Outcome:
    """What becomes of a bin that no worker survives."""
    return Outcome(job, (), reason)


def _rewrite(
    files: LakeFiles, bins: list[Bin], executor: Executor, report: Compaction, on_progress: Progress | None
) -> list[Rewritten]:
    """Rewrite bins and commit them; returns those that other jobs have changed meanwhile."""
    late: list[Rewritten] = []
    finished: list[Rewritten] = []
    failed: list[Outcome] = []
    num_scenarios, committed_at = 0, time.monotonic()
    if on_progress:
        on_progress(0, len(bins), 0)
    for done, outcome in enumerate(executor(bins, compact_bin, _lost), start=1):
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
    _, late = commits.replace_files(files, finished, f"compact for {report.profile}")
    for each in finished:
        if each not in late:
            report.count(each)
    return late
