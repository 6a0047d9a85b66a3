"""Compaction: rewrite many small files into a few, in the profile that suits their use.

Whole shards are rewritten, one bin at a time, concurrently with readers and writers: old snapshots keep their files,
and a bin that another job changes in the meantime is skipped and planned again. The next run adopts the files that a
killed run has finished.
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
from scenarionet_data.storage.files.places import LakeFilesLike, open_files
from scenarionet_data.storage.snapshots import commit as commits
from scenarionet_data.storage.snapshots import manifests
from scenarionet_data.storage.snapshots import snapshot as snapshots
from scenarionet_data.storage.snapshots.commit import Rewritten
from scenarionet_data.storage.snapshots.shard_record import ShardRecord
from scenarionet_data.storage.write import layouts, rewriting

ROUNDS = 3
_COMMIT_EVERY = 3600.0


@dataclass(frozen=True)
class BinResult:
    """Result of rewriting a bin.

    Attributes:
        bin: The bin.
        records: The rewritten shards; empty if it failed.
        error: Why it failed.
    """

    bin: Bin
    records: tuple[ShardRecord, ...]
    error: str | None = None


@dataclass
class Compaction:
    """Result of a compaction.

    Attributes:
        profile: Name of the profile.
        shards: Number of rewritten shards.
        scenarios: Number of their scenarios.
        files_before, files_after: Number of their files of tracks, lights and maps.
        bytes_before, bytes_after: Total size of these files.
        failed: Name of the first shard of each failed bin, and the reason.
        left: Number of shards skipped because other jobs kept changing them; run again for these.
        snapshot: Number of the lake's newest snapshot.
        seconds: Time taken.
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
        """Add a committed bin."""
        before, after = content_sizes(rewritten.old), content_sizes(rewritten.new)
        self.shards += len(rewritten.new)
        self.scenarios += sum(record.num_scenarios for record in rewritten.new)
        self.files_before += len(before)
        self.files_after += len(after)
        self.bytes_before += sum(before.values())
        self.bytes_after += sum(after.values())


def compact(
    lake: LakeFilesLike,
    profile: str = "training",
    *,
    where: Mapping[str, str] | None = None,
    workers: int = 1,
    executor: Executor | None = None,
    on_progress: Progress | None = None,
) -> Compaction:
    """Rewrite a lake's files in a profile as one new snapshot; ids, content hashes and databases do not change.

    Args:
        lake: The lake, its folder or its URL.
        profile: ``training``: one scenario per row group, up to 64 per file; ``analytics``: 16 and up to 1,024;
            ``archive``: as ``training``, in zstd.
        where: Shell patterns for ``dataset``, ``version`` and ``split``; all shards by default.
        workers: Number of processes.
        executor: Rewrites the bins instead of local processes, for example on a cluster.
        on_progress: Called before the first bin and after each one.

    Raises:
        BadParameter: Unknown profile, or unknown key in ``where``.
        NoSuchSnapshot: Not a lake.
        LakeError: The lake cannot be written.
    """
    started = time.monotonic()
    files, report = open_files(lake), Compaction(profile)
    files.sweep()
    for _ in range(ROUNDS):
        bins = plan_compaction(lake, profile, where=where)
        if on_progress:
            on_progress(0, len(bins), 0)
        workers_for = executor or executor_for(workers, len(bins))
        done, late, failed = rewrite_bins(files, bins, workers_for, f"compact for {profile}", on_progress)
        for each in done:
            report.count(each)
        current = {record.key: record for record in manifests.shards(files, snapshots.read(files))} if failed else {}
        report.failed = []
        for result in failed:
            if all(current.get(record.key) == record for record in result.bin.records):
                report.failed.append((result.bin.records[0].name, str(result.error)))
            else:  # other jobs have replaced its files in the meantime
                late.append(Rewritten(result.bin.records, ()))
        report.left = sum(len(each.old) for each in late)
        if not late:
            break
    report.snapshot = snapshots.read(files).number
    report.seconds = time.monotonic() - started
    return report


def rewrite_bin(job: Bin) -> BinResult:
    """Rewrite one bin, or adopt files of an earlier run, without committing. Runs on a worker."""
    files = open_files(job.lake)
    try:
        if job.num_scenarios:
            records = rewriting.rewrite(files, job.records, layouts.load(job.profile))
        else:
            records = [rewriting.rewrite_shared_map(files, record) for record in job.records]
    except LakeError as error:  # a damaged file must not prevent that the others are rewritten
        return BinResult(job, (), str(error))
    return BinResult(job, tuple(records))


def lost_bin(job: Bin, reason: str) -> BinResult:
    """Make the result of a bin that kills its worker."""
    return BinResult(job, (), reason)


def rewrite_bins(
    files: LakeFiles, bins: list[Bin], executor: Executor, operation: str, on_progress: Progress | None
) -> tuple[list[Rewritten], list[Rewritten], list[BinResult]]:
    """Rewrite bins and commit them, every hour and at the end.

    Returns:
        Those committed; those that other jobs have changed in the meantime; those that failed.
    """
    done, late, finished = list[Rewritten](), list[Rewritten](), list[Rewritten]()
    failed = list[BinResult]()

    def commit() -> None:
        if finished:
            _, changed = commits.replace_files(files, finished, operation)
            late.extend(changed)
            done.extend(each for each in finished if each not in changed)
            finished.clear()

    num_scenarios, committed_at = 0, time.monotonic()
    for number, result in enumerate(executor(bins, rewrite_bin, lost_bin), start=1):
        if result.error:
            failed.append(result)
        else:
            finished.append(Rewritten(result.bin.records, result.records))
        num_scenarios += result.bin.num_scenarios
        if on_progress:
            on_progress(number, len(bins), num_scenarios)
        if time.monotonic() - committed_at > _COMMIT_EVERY:  # a vacuum deletes uncommitted files after a day
            commit()
            committed_at = time.monotonic()
    commit()
    return done, late, failed
