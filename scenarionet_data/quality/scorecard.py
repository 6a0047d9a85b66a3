"""The scorecard of a lake: how many scenarios of each split break which rule, and how much of the split is there."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from typing import Any

import pyarrow as pa
import pyarrow.compute as pc

from scenarionet_data import converters
from scenarionet_data.converters.base import Budgets
from scenarionet_data.quality import releases
from scenarionet_data.quality.releases import Coverage
from scenarionet_data.quality.report import Findings
from scenarionet_data.quality.rules import PARTITION, Check
from scenarionet_data.storage.snapshots import manifests
from scenarionet_data.storage.snapshots.shard_record import ShardRecord

_NUM_EXAMPLES = 3


@dataclass(frozen=True)
class Mark:
    """How the scenarios of a partition fare with a rule.

    Attributes:
        check: The rule's name.
        is_hard: Whether it is structural.
        broken: Scenarios that break it.
        share: Of the partition's scenarios.
        is_met: None breaks it; or, of a soft rule, no more than the dataset's budget allows.
        examples: The first few: scenario id and detail.
    """

    check: str
    is_hard: bool
    broken: int
    share: float
    is_met: bool
    examples: tuple[tuple[str, str], ...]


@dataclass(frozen=True)
class Partition:
    """A dataset's split in the lake, or the part of it that belongs to a database.

    Attributes:
        dataset, version, split: Which it is.
        scenarios: How many were looked at.
        quarantined: Scenarios that were rejected; of the whole split.
        budgets: What soft rules allow its scenarios.
        coverage: How much of the published split is there; None when nothing is published.
        marks: One of each rule.
    """

    dataset: str
    version: str
    split: str
    scenarios: int
    quarantined: int
    budgets: Budgets
    coverage: Coverage | None
    marks: tuple[Mark, ...]


@dataclass(frozen=True)
class Scorecard:
    """Everything :func:`make_scorecard` says.

    Attributes:
        partitions: By dataset, version and split.
        others: Rule and detail of what is no scenario: shared maps, shards.
    """

    partitions: tuple[Partition, ...]
    others: tuple[tuple[str, str], ...]

    @property
    def rows(self) -> list[dict[str, Any]]:
        """One row of a table for each partition and rule."""
        return [
            {name: getattr(partition, name) for name in (*PARTITION, "scenarios", "quarantined")}
            | {name: getattr(mark, name) for name in ("check", "is_hard", "broken", "share", "is_met")}
            | {"example": ": ".join(mark.examples[0]) if mark.examples else None}
            | {"published": partition.coverage.text if partition.coverage else None}
            for partition in self.partitions
            for mark in partition.marks
        ]

    def to_dict(self) -> dict[str, Any]:
        """As plain data, for JSON."""
        content = asdict(self)
        for plain, partition in zip(content["partitions"], self.partitions, strict=True):
            if partition.coverage:
                plain["coverage"] |= {
                    name: getattr(partition.coverage, name) for name in ("is_whole", "is_as_published", "text")
                }
        return content


def make_scorecard(findings: Findings) -> Scorecard:
    """The scorecard of what checks found."""
    shards = manifests.shards(findings.holder.files, findings.holder.snapshot)
    rejected: Counter[tuple[str, ...]] = Counter()
    for shard in shards:
        rejected[shard.dataset, shard.version, shard.split] += shard.num_quarantined
    others = findings.rows.filter(pc.field("scenario_id").is_null()).select(["check", "detail"]).to_pylist()
    totals = findings.totals.sort_by([(name, "ascending") for name in PARTITION])
    return Scorecard(
        tuple(_partition(findings, row, shards, rejected) for row in totals.to_pylist()),
        tuple((row["check"], row["detail"]) for row in others),
    )


def _partition(
    findings: Findings, total: dict[str, Any], shards: Sequence[ShardRecord], rejected: Counter[tuple[str, ...]]
) -> Partition:
    name = (total["dataset"], total["version"], total["split"])
    budgets, count = converters.budgets(name[0]), total["scenarios"]
    chosen = [pc.field(column) == value for column, value in zip(PARTITION, name, strict=True)]
    rows = findings.rows.filter(chosen[0] & chosen[1] & chosen[2])
    marks = tuple(_mark(rows, check, count, budgets.outliers) for check in findings.checks)
    whole = findings.database is None
    return Partition(*name, count, rejected[name], budgets, releases.coverage(name, shards) if whole else None, marks)


def _mark(rows: pa.Table, check: Check, scenarios: int, outliers: float) -> Mark:
    broken = rows.filter(pc.field("check") == check.name)
    allowed = 0.0 if check.is_hard else outliers * scenarios
    examples = broken.slice(0, _NUM_EXAMPLES).select(["scenario_id", "detail"]).to_pylist()
    return Mark(
        check=check.name,
        is_hard=check.is_hard,
        broken=broken.num_rows,
        share=broken.num_rows / scenarios,
        is_met=broken.num_rows <= allowed,
        examples=tuple((row["scenario_id"], row["detail"]) for row in examples),
    )
