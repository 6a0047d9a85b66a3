"""The verdict on a new policy: one measure that is chosen before decides, the others are looked at, corrected."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Literal

import polars as pl

from scenarionet_data import Lake
from scenarionet_data.arrays.dtypes import Float64
from scenarionet_data.errors import BadParameter
from scenarionet_sim.evaluation.comparison import LOWER_IS_BETTER, METRICS
from scenarionet_sim.regression.failures import FailureCluster, clustered, failure_kind, failure_of, severity
from scenarionet_sim.regression.paired import corrected, paired_interval, paired_p_value, scenarios_needed

RegressionVerdict = Literal["better", "no worse", "worse", "undecided"]

PRIMARY = "nuplan_score"
PRIMARIES = tuple(name for name in METRICS if name != "average_displacement")
"""Measures that can decide: from 0 to 1, so that a scenario which could not be simulated has the worst value."""


@dataclass(frozen=True)
class MeasuredChange:
    """A measure of both policies, over the scenarios that have a value of both.

    Attributes:
        measure: Its name.
        old, new: Means.
        change, low, high: Mean of the differences and its 95 % interval.
        scenarios, differing: Number of scenarios, and of those that have different values.
        p_value: Two-sided; of measures that do not decide, corrected for their number.
    """

    measure: str
    old: float
    new: float
    change: float
    low: float
    high: float
    scenarios: int
    differing: int
    p_value: float

    @classmethod
    def between(cls, old: pl.DataFrame, new: pl.DataFrame, measure: str) -> MeasuredChange | None:
        """Return the change of a measure in rows of one scenario each; None if none has a value of both."""
        old, new = (each.select("scenario_id", measure).drop_nulls() for each in (old, new))
        pairs = old.join(new, on="scenario_id", suffix="_then", maintain_order="left")
        if not len(pairs):
            return None
        before, after = pairs[measure].to_numpy(), pairs[f"{measure}_then"].to_numpy()
        differences: Float64 = after - before
        found, differing = paired_interval(differences), int((differences != 0.0).sum())
        means = float(before.mean()), float(after.mean())
        return cls(
            measure, *means, found.mean, found.low, found.high, len(pairs), differing, paired_p_value(differences)
        )

    def significantly(self, level: float) -> Literal["better", "worse", ""]:
        """Return in which direction it differs; empty if that may be chance."""
        if self.p_value >= level or not self.change:
            return ""
        return "worse" if (self.change < 0.0) != (self.measure in LOWER_IS_BETTER) else "better"


@dataclass(frozen=True)
class Judgement:
    """A new policy beside an old one.

    Attributes:
        verdict: ``worse`` or ``better`` if the deciding measure is so significantly; ``no worse`` if its whole interval
            is above what may be lost, or no scenario differs; otherwise ``undecided``.
        primary: The measure that decides.
        others: The others, corrected.
        level: Probability of a false alarm of the deciding measure, in either direction, and of the others together.
        needed: Scenarios that would decide, if the policies are alike; 0 if it is decided.
        broken: Scenarios that could not be simulated with the old policy, and with the new one.
        fixed: Scenarios that only the old policy fails, or worse.
        clusters: What only the new policy fails, or worse.
    """

    verdict: RegressionVerdict
    primary: MeasuredChange
    others: tuple[MeasuredChange, ...]
    level: float
    needed: int
    broken: tuple[int, int]
    fixed: int
    clusters: tuple[FailureCluster, ...]

    def sentence(self) -> str:
        """Return the verdict in words."""
        each, count = self.primary, sum(len(cluster.failures) for cluster in self.clusters)
        numbers = (
            f"{each.measure} {each.old:.4f} -> {each.new:.4f}, {each.change:+.4f} [{each.low:+.4f}, {each.high:+.4f}], "
            f"p = {each.p_value:.2g}, {each.differing:,} of {each.scenarios:,} scenarios differ"
        )
        worse = [one.measure for one in self.others if one.significantly(self.level) == "worse"]
        words = {
            "undecided": f"undecided, about {self.needed:,} scenarios would tell",
            "worse": "significantly worse",
            "better": "significantly better",
        }
        rest = f"; significantly worse in {len(worse)} of {len(self.others)} other measures" + (
            f" ({', '.join(worse)})" if worse else ""
        )
        verdict = words.get(self.verdict, self.verdict)
        return f"new is {verdict}: {numbers}{rest}; {count:,} new failures, {self.fixed:,} fixed"


def judge(
    lake: Lake,
    ids: Sequence[str],
    old: Sequence[str],
    new: Sequence[str],
    *,
    primary: str = PRIMARY,
    margin: float = 0.02,
    level: float = 0.05,
) -> Judgement:
    """Judge the runs of a new policy against those of an old one.

    Args:
        lake: The lake with the runs.
        ids: The scenarios.
        old, new: Runs of each; of a scenario in several, the last one counts.
        primary: The measure that decides, a name in PRIMARIES.
        margin: What may be lost of it.
        level: See :class:`Judgement`.

    Raises:
        BadParameter: The measure is none, or has no value in both.
    """
    if primary not in PRIMARIES:
        raise BadParameter(f"primary={primary!r}; choose from {', '.join(PRIMARIES)}")
    if not (0.0 < margin < 1.0 and 0.0 < level < 0.5):
        raise BadParameter(f"margin={margin}, level={level}: wanted more than 0, and less than 1 and 0.5")
    before, after = (_results(lake, ids, runs) for runs in (old, new))
    means = [_means(each, worst=primary) for each in (before, after)]
    changes = {}
    for name in METRICS:
        change = MeasuredChange.between(means[0], means[1], name)
        if change is not None:
            changes[name] = change
    if primary not in changes:
        raise BadParameter(
            f"{primary} has no value in both runs of any scenario; choose another measure that decides, such as success"
        )
    decides = changes.pop(primary)
    holm = corrected([each.p_value for each in changes.values()])
    others = tuple(
        MeasuredChange(**vars(each) | {"p_value": p_value})
        for each, p_value in zip(changes.values(), holm, strict=True)
    )
    sign = -1.0 if primary in LOWER_IS_BETTER else 1.0
    lowest = min(sign * decides.low, sign * decides.high)
    verdict: RegressionVerdict = decides.significantly(level) or (
        "no worse" if lowest > -margin or not decides.differing else "undecided"
    )
    needed = scenarios_needed(decides.low, decides.high, decides.scenarios, margin) if verdict == "undecided" else 0
    failed = [_failing(each) for each in (before, after)]
    lost = dict(
        means[0].join(means[1], on="scenario_id", suffix="_then")
        .select("scenario_id", sign * (pl.col(f"{primary}_then") - pl.col(primary))).rows()
    )  # fmt: skip
    rows = {row["scenario_id"]: row for row in after.to_dicts() if failed[1][row["scenario_id"]]}
    failures = [
        failure_of(row, lost.get(each) or 0.0, row["duration"])
        for each, row in rows.items()
        if severity(failed[1][each]) > severity(failed[0].get(each, ""))
    ]
    broken = [int(each.filter(pl.col("error").is_not_null())["scenario_id"].n_unique()) for each in (before, after)]
    fixed = sum(severity(kind) > severity(failed[1].get(each, "")) for each, kind in failed[0].items())
    return Judgement(verdict, decides, others, level, needed, (broken[0], broken[1]), fixed, clustered(failures))


def _results(lake: Lake, ids: Sequence[str], runs: Sequence[str]) -> pl.DataFrame:
    """Rows of results of some scenarios with their measures, each from its last run."""
    measures = ", ".join(f"({sql})::DOUBLE AS measured_{name}" for name, sql in METRICS.items())
    query = f"""
        SELECT results.*, duration, {measures} FROM results JOIN metadata USING (scenario_id)
        WHERE list_contains($runs, run) AND scenario_id IN (SELECT unnest($ids))
        QUALIFY run = max(run) OVER (PARTITION BY scenario_id) ORDER BY scenario_id, rollout
    """
    return lake.sql(query, {"runs": list(runs), "ids": list(ids)})


def _means(rows: pl.DataFrame, worst: str) -> pl.DataFrame:
    """One row per scenario: means over its rollouts; where one failed to simulate, the worst value of a measure."""
    values = [pl.col(f"measured_{name}").alias(name) for name in METRICS if name != worst]
    least = 1.0 if worst in LOWER_IS_BETTER else 0.0
    decides = pl.when(pl.col("error").is_not_null()).then(least).otherwise(pl.col(f"measured_{worst}")).alias(worst)
    return rows.select("scenario_id", *values, decides).group_by("scenario_id", maintain_order=True).mean()


def _failing(rows: pl.DataFrame) -> Mapping[str, str]:
    """The worst that went wrong in each scenario; empty if nothing did."""
    found: dict[str, str] = {}
    for row in rows.to_dicts():
        kinds = found.get(row["scenario_id"], ""), failure_kind(row, row["duration"])
        found[row["scenario_id"]] = max(kinds, key=severity)
    return found
