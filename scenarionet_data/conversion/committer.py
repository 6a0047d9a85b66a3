"""Finished shards on their way into the lake: committed now and then, and counted."""

from __future__ import annotations

import time

from scenarionet_data.conversion.jobs import Outcome
from scenarionet_data.conversion.plan import Plan
from scenarionet_data.conversion.report import Report
from scenarionet_data.execution.worker_stats import WorkerStats
from scenarionet_data.storage.files.lake_files import LakeFiles
from scenarionet_data.storage.snapshots import commit as commits
from scenarionet_data.storage.snapshots.shard_record import ShardRecord

_COMMIT_EVERY = 30.0


class Basket:
    """Finished shards on their way into the lake, and the report on them."""

    def __init__(self, files: LakeFiles, plan: Plan, operation: str, report: Report) -> None:
        self._files = files
        self._plan = plan
        self._operation = operation
        self._report = report
        self._finished: list[ShardRecord] = []
        self._committed_at = time.monotonic()

    def add(self, outcome: Outcome) -> None:
        """Count an outcome; commit now and then, so that a killed job loses little."""
        report, record = self._report, outcome.record
        if outcome.worker is not None:
            scenarios = {"scenarios": record.num_scenarios, "bytes": sum(record.sizes)} if record else {"failed": 1}
            stats = report.workers.setdefault(outcome.worker, WorkerStats())
            stats.add(outcome.seconds, outcome.peak_memory, scenarios)
        if record is None:
            report.failed.append((outcome.shard, outcome.error or "unknown"))
            return
        report.converted += record.num_scenarios
        report.quarantined += record.num_quarantined
        report.size += sum(record.sizes)
        report.shards += 1
        report.adopted += outcome.was_finished
        if record.num_scenarios or record.num_quarantined:  # a shared map has no split
            report.partitions.add((record.dataset, record.version, record.split))
        self._finished.append(record)
        if time.monotonic() - self._committed_at > _COMMIT_EVERY and not self._plan.replaced:
            self.commit()

    def commit(self) -> None:
        """Commit what is finished and may be, and report what may not."""
        finished = self._finished
        while True:
            ready, gone = self._plan.settle(finished)
            refused = commits.commit(self._files, ready, self._operation, gone).refused
            for record, scenario_id in refused:
                self._leave_out(record, _duplicate_message(scenario_id))
            if not (refused and gone):
                break
            # Nothing was committed: without what was refused, others may have to wait.
            keys = {record.key for record, _ in refused}
            finished = [record for record in finished if record.key not in keys]
        settled = {record.key for record in ready}
        for record in finished:
            if record.key not in settled:
                self._leave_out(record, _WAITS)
        self._report.replaced += len(gone)
        self._finished = []
        self._committed_at = time.monotonic()

    def _leave_out(self, record: ShardRecord, reason: str) -> None:
        self._report.failed.append((record.name, reason))
        self._report.converted -= record.num_scenarios
        self._report.shards -= 1


_WAITS = (
    "it would replace scenarios together with shards that failed; mend those and run the same command again: "
    "it is finished and will be adopted"
)


def _duplicate_message(scenario_id: str) -> str:
    """What to do about a scenario that is in the lake already."""
    return (
        f"scenario {scenario_id} is in the lake already, from another source or split; "
        "give these recordings a --version of their own, or --replace the old ones"
    )
