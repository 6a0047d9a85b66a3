"""What a conversion did."""

from __future__ import annotations

from dataclasses import dataclass, field

from scenarionet_data.execution.worker_stats import WorkerStats


@dataclass
class Report:
    """What a conversion did.

    Attributes:
        converted: Scenarios written.
        quarantined: Scenarios rejected.
        shards: Shards converted.
        adopted: Shards that an earlier, interrupted job had finished.
        skipped: Shards that were in the lake already.
        replaced: Shards whose scenarios were taken out for newer ones.
        stale: Shards in the lake that another converter version wrote, and that stay.
        partitions: Where the scenarios went: dataset, version, split.
        failed: Shard name and reason.
        seconds: Time it took.
        snapshot: The lake's newest snapshot.
        size: Bytes written.
        workers: What each worker did, with counts of scenarios and bytes.
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
        """Whether nothing failed and nothing was quarantined."""
        return not self.failed and not self.quarantined
