"""The report of a conversion."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field

from scenarionet_data.execution.worker_stats import WorkerStats
from scenarionet_data.ingest.defects import merge_defects
from scenarionet_data.ingest.passed_over import PassedOver
from scenarionet_data.scenario.defects import Defect


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
