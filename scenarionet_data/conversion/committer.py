"""Commits finished shards, in batches, and counts them in the report."""

from __future__ import annotations

import time

from scenarionet_data.conversion.jobs import ShardResult
from scenarionet_data.conversion.plan import ConversionPlan
from scenarionet_data.conversion.report import ConversionReport
from scenarionet_data.execution.worker_stats import WorkerStats
from scenarionet_data.storage.files.lake_files import LakeFiles
from scenarionet_data.storage.snapshots import commit as commits
from scenarionet_data.storage.snapshots.shard_record import ShardRecord, read_defects

_COMMIT_EVERY = 30.0
_WAITS = (
    "it would replace scenarios together with shards that failed; fix those and run the same command again: "
    "this shard is finished and will be adopted"
)


class Committer:
    """Commits finished shards and counts them in the report.

    Args:
        files: The lake.
        plan: Which old shards the new ones replace.
        operation: Operation recorded in the snapshot, for example ``convert waymo``.
        report: Updated with every result.
        in_one: Commit nothing before the end.
    """

    def __init__(
        self,
        files: LakeFiles,
        plan: ConversionPlan,
        operation: str,
        report: ConversionReport,
        in_one: bool = False,
    ) -> None:
        self._files = files
        self._plan = plan
        self._operation = operation
        self._report = report
        self._finished: list[ShardRecord] = []
        self._in_one = in_one
        self._committed_at = time.monotonic()

    def add(self, result: ShardResult) -> None:
        """Count a result; commit every 30 seconds, so that a killed run loses little."""
        report, record = self._report, result.record
        if result.worker is not None:
            stats = report.workers.setdefault(result.worker, WorkerStats())
            counts = {"scenarios": record.num_scenarios, "bytes": sum(record.sizes)} if record else {"failed": 1}
            stats.add(result.seconds, result.peak_memory, counts)
        if record is None:
            report.failed.append((result.shard, result.error or "unknown"))
            return
        report.converted += record.num_scenarios
        report.quarantined += record.num_quarantined
        report.size += sum(record.sizes)
        report.shards += 1
        report.adopted += result.was_finished
        if record.num_scenarios or record.num_quarantined:  # a shared map has no split
            report.partitions.add((record.dataset, record.version, record.split))
        self._finished.append(record)
        is_due = time.monotonic() - self._committed_at > _COMMIT_EVERY and not self._in_one
        if is_due and not self._plan.replaced:
            self.commit()

    def commit(self) -> None:
        """Commit the finished shards that may be committed; report the others as failed."""
        finished = self._finished
        while True:
            ready, removed = self._plan.settle(finished)
            done = commits.commit(self._files, ready, self._operation, removed)
            refused = done.refused
            for record, scenario_id in refused:
                self._leave_out(
                    record,
                    f"scenario {scenario_id} is in the lake already, from another source or split; "
                    "give these recordings a version of their own, or pass replace=True to replace the old ones",
                )
            if not (refused and removed):
                break
            # Nothing was committed: without the refused shards, others may have to wait.
            keys = {record.key for record, _ in refused}
            finished = [record for record in finished if record.key not in keys]
        settled = {record.key for record in ready}
        reduced = {old.key: new for old, new in done.reduced}
        self._count_duplicates(done.reduced)
        refused_keys = {record.key for record, _ in refused}
        kept = [reduced.get(record.key, record) for record in ready if record.key not in refused_keys]
        self._report.add_defects(defect for record in kept for defect in read_defects(self._files, record))
        for record in finished:
            if record.key not in settled:
                self._leave_out(record, _WAITS)
        self._report.replaced += len(removed)
        self._finished = []
        self._committed_at = time.monotonic()

    def _count_duplicates(self, reduced: commits.Reduced) -> None:
        for old, new in reduced:
            number = old.num_scenarios - new.num_scenarios
            self._report.converted -= number
            self._report.quarantined += number
            self._report.duplicates += number

    def _leave_out(self, record: ShardRecord, reason: str) -> None:
        self._report.failed.append((record.name, reason))
        self._report.converted -= record.num_scenarios
        self._report.shards -= 1
