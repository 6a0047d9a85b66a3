"""The report of a conversion."""

from __future__ import annotations

from dataclasses import dataclass, field

from scenarionet_data.execution.worker_stats import WorkerStats


@dataclass
class ConversionReport:
    """Result of a conversion.

    Attributes:
        converted: Scenarios written.
        quarantined: Scenarios rejected.
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
    def is_clean(self) -> bool:
        """Whether no shard failed and no scenario was quarantined."""
        return not self.failed and not self.quarantined
