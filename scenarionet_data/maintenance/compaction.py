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
COMMIT_EVERY = 3600.0


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
        profile: ``training``: one scenario per row group, up to 64 per file; ``analytics``: 16 and up to 1,024.
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
        late = _rewrite(files, bins, executor or executor_for(min(workers, len(bins))), report, on_progress)
        report.left = sum(len(each.old) for each in late)
        if not late:
            break
    report.snapshot = snapshots.read(files).number
    report.seconds = time.monotonic() - started
    return report


def compact_bin(job: Bin) -> BinResult:
    """Rewrite one bin, or adopt files of an earlier run, without committing. Runs on a worker."""
    try:
        records = rewriting.rewrite(open_files(job.lake), job.records, layouts.load(job.profile))
    except LakeError as error:  # a damaged file must not prevent compaction of the others
        return BinResult(job, (), str(error))
    return BinResult(job, tuple(records))


def lost_bin(job: Bin, reason: str) -> BinResult:
    """Make the result of a bin that kills its worker."""
    return BinResult(job, (), reason)


def _rewrite(
    files: LakeFiles, bins: list[Bin], executor: Executor, report: Compaction, on_progress: Progress | None
) -> list[Rewritten]:
    """Rewrite bins and commit them; return those that other jobs have changed in the meantime."""
    late: list[Rewritten] = []
    finished: list[Rewritten] = []
    failed: list[BinResult] = []
    num_scenarios, committed_at = 0, time.monotonic()
    if on_progress:
        on_progress(0, len(bins), 0)
    for done, result in enumerate(executor(bins, compact_bin, lost_bin), start=1):
        if result.error:
            failed.append(result)
        else:
            finished.append(Rewritten(result.bin.records, result.records))
        num_scenarios += result.bin.num_scenarios
        if on_progress:
            on_progress(done, len(bins), num_scenarios)
        if (
            time.monotonic() - committed_at > COMMIT_EVERY
        ):  # well within the day after which a vacuum deletes uncommitted files
            late += _commit(files, finished, report)
            finished, committed_at = [], time.monotonic()
    late += _commit(files, finished, report)
    return late + _report_failed(files, failed, report)


def _report_failed(files: LakeFiles, failed: list[BinResult], report: Compaction) -> list[Rewritten]:
    """Report why bins failed; return those whose files were replaced by other jobs in the meantime."""
    report.failed = []
    late = []
    current = {record.key: record for record in manifests.shards(files, snapshots.read(files))} if failed else {}
    for result in failed:
        if all(current.get(record.key) == record for record in result.bin.records):
            report.failed.append((result.bin.records[0].name, str(result.error)))
        else:
            late.append(Rewritten(result.bin.records, ()))
    return late


def _commit(files: LakeFiles, finished: list[Rewritten], report: Compaction) -> list[Rewritten]:
    if not finished:
        return []
    _, late = commits.replace_files(files, finished, f"compact for {report.profile}")
    for each in finished:
        if each not in late:
            report.count(each)
    return late
