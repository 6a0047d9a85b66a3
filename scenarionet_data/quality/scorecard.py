"""Scorecard of a lake: violations of each rule by split, and how complete each split is."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from typing import Any

import pyarrow as pa
import pyarrow.compute as pc

from scenarionet_data import converters
from scenarionet_data.converters.base import Budgets
from scenarionet_data.errors import BadParameter
from scenarionet_data.quality import releases
from scenarionet_data.quality.releases import Coverage
from scenarionet_data.quality.report import CheckReport
from scenarionet_data.quality.rules import PARTITION, Check
from scenarionet_data.storage.snapshots import manifests
from scenarionet_data.storage.snapshots.shard_record import ShardRecord

_NUM_EXAMPLES = 3


@dataclass(frozen=True)
class RuleScore:
    """Violations of a rule by the scenarios of a partition.

    Attributes:
        check: Name of the rule.
        is_hard: Whether it is a hard rule.
        broken: Number of scenarios that violate it.
        share: Their share of the partition.
        is_met: No violations; for a soft rule, no more than the budget of the dataset allows.
        examples: The first few: scenario id and detail.
    """

    check: str
    is_hard: bool
    broken: int
    share: float
    is_met: bool
    examples: tuple[tuple[str, str], ...]


@dataclass(frozen=True)
class PartitionScore:
    """Scores of a split of a dataset, or of the part of it that belongs to a database.

    Attributes:
        dataset, version, split: The partition.
        scenarios: Number of checked scenarios.
        quarantined: Number of rejected scenarios of the whole split.
        budgets: Budgets of soft rules.
        coverage: Coverage of the published split; None if no numbers are published.
        rules: One score per rule.
    """

    dataset: str
    version: str
    split: str
    scenarios: int
    quarantined: int
    budgets: Budgets
    coverage: Coverage | None
    rules: tuple[RuleScore, ...]


@dataclass(frozen=True)
class Scorecard:
    """Scores of all partitions of a lake or database.

    Attributes:
        partitions: By dataset, version and split.
        others: Rule and detail of violations by shared maps and shards.
    """

    partitions: tuple[PartitionScore, ...]
    others: tuple[tuple[str, str], ...]

    @property
    def rows(self) -> list[dict[str, Any]]:
        """One row per partition and rule."""
        return [
            {name: getattr(partition, name) for name in (*PARTITION, "scenarios", "quarantined")}
            | {name: getattr(score, name) for name in ("check", "is_hard", "broken", "share", "is_met")}
            | {"example": ": ".join(score.examples[0]) if score.examples else None}
            | {"published": partition.coverage.text if partition.coverage else None}
            for partition in self.partitions
            for score in partition.rules
        ]

    def to_dict(self) -> dict[str, Any]:
        """Return plain data for JSON."""
        content = asdict(self)
        for plain, partition in zip(content["partitions"], self.partitions, strict=True):
            if partition.coverage:
                plain["coverage"] |= {
                    name: getattr(partition.coverage, name) for name in ("is_whole", "is_as_published", "text")
                }
        return content


def make_scorecard(report: CheckReport) -> Scorecard:
    """Return the scorecard of a check report.

    Raises:
        BadParameter: It is something else.
    """
    if not isinstance(report, CheckReport):
        raise BadParameter(f"expected the report of run_checks(lake), found {report!r}")
    shards = manifests.shards(report.view.files, report.view.snapshot)
    rejected: Counter[tuple[str, ...]] = Counter()
    for shard in shards:
        rejected[shard.dataset, shard.version, shard.split] += shard.num_quarantined
    others = report.rows.filter(pc.field("scenario_id").is_null()).select(["check", "detail"]).to_pylist()
    totals = report.totals.sort_by([(name, "ascending") for name in PARTITION])
    return Scorecard(
        tuple(_partition(report, row, shards, rejected) for row in totals.to_pylist()),
        tuple((row["check"], row["detail"]) for row in others),
    )


def _partition(
    report: CheckReport, total: dict[str, Any], shards: Sequence[ShardRecord], rejected: Counter[tuple[str, ...]]
) -> PartitionScore:
    name = (total["dataset"], total["version"], total["split"])
    budgets, count = converters.budgets(name[0]), total["scenarios"]
    chosen = [pc.field(column) == value for column, value in zip(PARTITION, name, strict=True)]
    rows = report.rows.filter(chosen[0] & chosen[1] & chosen[2])
    scores = tuple(_score(rows, check, count, budgets.outliers) for check in report.checks)
    whole = report.database is None
    return PartitionScore(
        *name, count, rejected[name], budgets, releases.coverage(name, shards) if whole else None, scores
    )


def _score(rows: pa.Table, check: Check, scenarios: int, outliers: float) -> RuleScore:
    broken = rows.filter(pc.field("check") == check.name)
    allowed = 0.0 if check.is_hard else outliers * scenarios
    examples = broken.slice(0, _NUM_EXAMPLES).select(["scenario_id", "detail"]).to_pylist()
    return RuleScore(
        check=check.name,
        is_hard=check.is_hard,
        broken=broken.num_rows,
        share=broken.num_rows / scenarios,
        is_met=broken.num_rows <= allowed,
        examples=tuple((row["scenario_id"], row["detail"]) for row in examples),
    )
