"""Commits finished shards, in batches, and counts them in the report."""

from __future__ import annotations

import time
from collections.abc import Iterable
from dataclasses import dataclass, field

from scenarionet_data.conversion.jobs import ShardResult
from scenarionet_data.conversion.plan import ConversionPlan
from scenarionet_data.execution.executors import WorkerStats
from scenarionet_data.execution.progress import Progress
from scenarionet_data.ingest.defects import merge_defects
from scenarionet_data.ingest.passed_over import PassedOver
from scenarionet_data.scenario.defects import Defect
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
        started: When the work began, by ``time.monotonic``.
        in_one: Commit nothing before the end.
    """

    def __init__(
        self,
        files: LakeFiles,
        plan: ConversionPlan,
        operation: str,
        report: ConversionReport,
        started: float,
        in_one: bool = False,
    ) -> None:
        self._files = files
        self._plan = plan
        self._operation = operation
        self._report = report
        self._finished: list[ShardRecord] = []
        self._in_one = in_one
        self._started = started
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

    def add_all(self, results: Iterable[ShardResult], number: int, on_progress: Progress | None) -> ConversionReport:
        """Add results as they come, commit the rest at the end, even after an error, and return the report.

        Args:
            results: Of the shards.
            number: Of the shards.
            on_progress: Called before the first result and after each one.
        """
        if on_progress:
            on_progress(0, number, 0)
        try:
            for done, result in enumerate(results, start=1):
                self.add(result)
                if on_progress:
                    on_progress(done, number, self._report.converted)
        finally:
            self.commit()
        return self.report()

    def report(self) -> ConversionReport:
        """Write the lake's last snapshot so that it is quick to read, and return the report."""
        self._report.snapshot = commits.consolidate(self._files).number
        self._report.seconds = time.monotonic() - self._started
        return self._report

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
        for old, new in done.reduced:
            number = old.num_scenarios - new.num_scenarios
            self._report.converted -= number
            self._report.quarantined += number
            self._report.duplicates += number
        refused_keys = {record.key for record, _ in refused}
        kept = [reduced.get(record.key, record) for record in ready if record.key not in refused_keys]
        for record in kept:
            defects = read_defects(self._files, record)
            if defects:
                self._report.add_defects(defects)
        for record in finished:
            if record.key not in settled:
                self._leave_out(record, _WAITS)
        self._report.replaced += len(removed)
        self._finished = []
        self._committed_at = time.monotonic()

    def _leave_out(self, record: ShardRecord, reason: str) -> None:
        self._report.failed.append((record.name, reason))
        self._report.converted -= record.num_scenarios
        self._report.shards -= 1


@dataclass
class ConversionReport:
    """Result of a conversion.

    Attributes:
        converted: Scenarios written.
        quarantined: Scenarios rejected.
        duplicates: Of these, scenarios whose id the lake has already, from another source or split.
        defects: What was dropped or assumed in the scenarios and maps that were written, by file and reason.
        passed_over: Raw files that were recognised and not used.
        shards: Shards converted.
        adopted: Shards that an earlier, interrupted run had finished.
        skipped: Shards that were in the lake already.
        replaced: Old shards removed in favour of new ones.
        stale: Shards in the lake written by another converter version and kept.
        partitions: Partitions written: dataset, version, split.
        failed: Shard name and reason.
        seconds: Time taken.
        snapshot: Number of the lake's newest snapshot.
        size: Bytes written.
        workers: Statistics by worker, with counts of scenarios and bytes.
    """

    converted: int = 0
    quarantined: int = 0
    duplicates: int = 0
    defects: tuple[Defect, ...] = ()
    passed_over: tuple[PassedOver, ...] = ()
    shards: int = 0
    adopted: int = 0
    skipped: int = 0
    replaced: int = 0
    stale: int = 0
    partitions: set[tuple[str, str, str]] = field(default_factory=set)
    failed: list[tuple[str, str]] = field(default_factory=list)
    seconds: float = 0.0
    snapshot: int = 0
    size: int = 0
    workers: dict[str, WorkerStats] = field(default_factory=dict)

    @property
    def dropped(self) -> int:
        """Rows and features that were dropped."""
        return sum(defect.count for defect in self.defects if defect.action == "dropped")

    @property
    def assumed(self) -> int:
        """Rows and features that were completed by an assumption."""
        return sum(defect.count for defect in self.defects if defect.action == "assumed")

    def add_defects(self, defects: Iterable[Defect]) -> None:
        """Count defects; those of one kind in one file become one."""
        self.defects = merge_defects((*self.defects, *defects))

    @property
    def is_clean(self) -> bool:
        """Whether no shard failed and no scenario was quarantined."""
        return not self.failed and not self.quarantined
