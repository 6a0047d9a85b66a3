"""Runs side by side: shares with their number of scenarios, paired differences, and the scenarios that changed."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl
import pyarrow as pa

from scenarionet_data import Lake
from scenarionet_data.errors import BadParameter
from scenarionet_data.query.lake_view import open_view
from scenarionet_data.schema import tables
from scenarionet_data.storage import evaluation_runs
from scenarionet_sim.evaluation.intervals import mean_interval

METRICS: Mapping[str, str] = {
    "success": "success::INTEGER",
    "out_of_road": "out_of_road::INTEGER",
    "timeout": "timeout::INTEGER",
    "crashed": "crashed::INTEGER",
    "at_fault": "(at_fault_collisions > 0)::INTEGER",
    "off_road": "off_road::INTEGER",
    "red_light": "(red_light_violations > 0)::INTEGER",
    "nuplan_score": "nuplan_score",
    "progress_ratio": "progress_ratio",
    "is_time_to_collision_in_bound": "is_time_to_collision_in_bound::INTEGER",
    "is_comfortable": "is_comfortable::INTEGER",
    "speed_limit_compliance": "speed_limit_compliance",
    "driving_direction": "driving_direction",
    "route_completion": "route_completion",
    "average_displacement": "average_displacement",
}
"""Metrics of a comparison as expressions over ``results``: shares of scenarios, scores and means."""

LOWER_IS_BETTER = frozenset(
    ("out_of_road", "timeout", "crashed", "at_fault", "off_road", "red_light", "average_displacement")
)
"""The metrics of which less is better; of the others more is."""

JUDGED_BY = "coalesce(nuplan_score, success::INTEGER - crashed::INTEGER)"
"""What decides unless told otherwise whether a scenario got better: higher is better."""

CONDITIONS = (
    ("rule", "what is scored", "as in older versions, see the guide"),
    ("backend", "the vehicle model", "unknown"),
    ("traffic", "the traffic", "unknown"),
    ("episode", "the episode", "unknown"),
)
"""Conditions of runs that should be the same: key of the description, title, and value of runs that do not have it."""

MADE = ("reference-", "regression-")
"""Beginnings of the names of runs that are made beside those of users."""

GivenRuns = Mapping[str, tuple[Mapping[str, Any], Sequence[Mapping[str, Any]]]]
"""Description and rows of ``results`` of runs by their names, as in receipts."""

ALL = "all"
"""Group of all scenarios."""


@dataclass(frozen=True)
class PairedChange:
    """Mean of the differences from the first run, over the scenarios that both have.

    Attributes:
        mean: Its value.
        low, high: 95 % interval of Student's t over the scenarios.
        scenarios: Number of scenarios.
    """

    mean: float
    low: float
    high: float
    scenarios: int


@dataclass(frozen=True)
class ComparedMetric:
    """A metric of every run.

    Attributes:
        metric: Its name.
        group: Value of what the scenarios are grouped by; ``all`` for all of them.
        means: Mean of each run over its scenarios, a share for yes and no; None without a value.
        scenarios: Number of scenarios with a value, by run.
        changes: From the first run to each; None for the first, and without a common scenario.
    """

    metric: str
    group: str
    means: tuple[float | None, ...]
    scenarios: tuple[int, ...]
    changes: tuple[PairedChange | None, ...]


@dataclass(frozen=True)
class RunComparison:
    """Runs side by side.

    Attributes:
        runs: Their names.
        metrics: Group by group, that of all scenarios first.
        judged_by: Expression that decides what is better.
        notes: What differs between the runs beside their drivers: vehicle model, traffic, rule of scoring.
        better, worse: Scenarios that it calls better or worse in the last run than in the first, and by how much, the
            largest change first.
    """

    runs: tuple[str, ...]
    metrics: tuple[ComparedMetric, ...]
    judged_by: str
    notes: tuple[str, ...]
    better: tuple[tuple[str, float], ...]
    worse: tuple[tuple[str, float], ...]

    def verdict(self) -> tuple[tuple[str, ...], tuple[str, ...], int]:
        """Judge the last run against the first by the metrics of all scenarios.

        Returns:
            The metrics in which it is significantly worse (the 95 % interval of the change excludes 0), those
            in which it is significantly better, and the number of metrics that both runs have.
        """
        changes = {each.metric: each.changes[-1] for each in self.metrics if each.group == ALL}
        known = {metric: change for metric, change in changes.items() if change is not None}
        fell = {metric for metric, change in known.items() if change.high < 0}
        rose = {metric for metric, change in known.items() if change.low > 0}
        worse = (fell - LOWER_IS_BETTER) | (rose & LOWER_IS_BETTER)
        in_order = [metric for metric in known if metric in fell | rose]
        return (
            tuple(metric for metric in in_order if metric in worse),
            tuple(metric for metric in in_order if metric not in worse),
            len(known),
        )

    def holds(self, condition: str, lake: Lake) -> bool:
        """Evaluate a condition on the last run, such as ``crashed > 0.01 OR nuplan_score_change < -0.02``.

        Args:
            condition: An SQL expression over the names of the metrics, and over the same names with ``_change``, the
                change from the first run.
            lake: Evaluates it.

        Raises:
            QueryError: It is no expression over these names.
            BadParameter: It is neither true nor false, because a metric has no value.
        """
        values = {}
        for each in self.metrics:
            if each.group == ALL:
                change = each.changes[-1]
                values[each.metric] = each.means[-1]
                values[f"{each.metric}_change"] = None if change is None else change.mean
        columns = ", ".join(f"${name}::DOUBLE AS {name}" for name in values)
        answer = lake.sql(f"SELECT ({condition}) AS answer FROM (SELECT {columns})", values)["answer"].item()
        if not isinstance(answer, bool):
            raise BadParameter(f"{condition!r} is {answer}, not true or false: a metric in it has no value in the run")
        return answer


def compare_runs(
    lake: Lake | str | Path,
    *runs: str,
    where: str = "true",
    by: str | None = None,
    event: str | None = None,
    judged_by: str = JUDGED_BY,
    given: GivenRuns | None = None,
) -> RunComparison:
    """Compare the results of runs; rollouts of a scenario are averaged first.

    Args:
        lake: The lake with the runs, its path or its URL.
        *runs: Their names, two or more; changes are from the first one.
        where: Condition over ``results`` and ``metadata`` that scenarios must satisfy.
        by: Expression over ``results`` and ``metadata`` to group the scenarios by, such as ``dataset``.
        event: Event to group the scenarios by, as for filters: those in which it happens, and the others.
        judged_by: Expression over ``results``, higher is better.
        given: The runs, instead of those in the lake.

    Raises:
        BadParameter: Fewer than two runs, one that the lake does not have, or both ``by`` and ``event``.
        QueryError: An expression is not valid.
    """
    if len(runs) < 2 or len(set(runs)) < len(runs):
        raise BadParameter(f"{len(runs)} runs to compare; give two or more different ones")
    if by is not None and event is not None:
        raise BadParameter("scenarios can be grouped by an expression or by an event, not by both; leave one out")
    lake = lake if isinstance(lake, Lake) else Lake(lake)
    known = list(given or lake.sql("SELECT DISTINCT run FROM results ORDER BY run")["run"])
    unknown = [run for run in runs if run not in known]
    if unknown:
        raise BadParameter(f"the lake has no run {unknown[0]!r}; it has {runs_in_words(known)}")
    rows = _rows(lake, runs, where, by, judged_by, given or {})
    if event is not None:
        ids = lake.select(events=[event]).scenario_ids
        happens = pl.col("scenario_id").is_in(ids)
        rows = rows.with_columns(group=pl.when(happens).then(pl.lit(event)).otherwise(pl.lit(f"without {event}")))
    groups = [ALL] if by is None and event is None else [ALL, *sorted(rows["group"].unique().to_list())]
    metrics = [
        _compared(rows if group == ALL else rows.filter(pl.col("group") == group), runs, metric, group)
        for group in groups
        for metric in METRICS
    ]
    first, last = (rows.filter(pl.col("run") == run).select("scenario_id", "judged") for run in (runs[0], runs[-1]))
    pairs = first.join(last, on="scenario_id", suffix="_then").drop_nulls()
    change = pairs.select("scenario_id", change=pl.col("judged_then") - pl.col("judged"))
    better = change.filter(pl.col("change") > 0).sort(["change", "scenario_id"], descending=[True, False]).rows()
    worse = change.filter(pl.col("change") < 0).sort(["change", "scenario_id"]).rows()
    told, notes = {run: given[run][0] if given else evaluation_runs.describe(lake.files, run) for run in runs}, []
    for key, condition, older in CONDITIONS:
        values = {run: str(each.get(key) or older) for run, each in told.items()}
        if len(set(values.values())) > 1:
            notes.append(f"{condition} differs: " + ", ".join(f"{run} {value}" for run, value in values.items()))
    return RunComparison(tuple(runs), tuple(metrics), judged_by, tuple(notes), tuple(better), tuple(worse))


def runs_in_words(names: Sequence[str]) -> str:
    """Return the names of runs for a message; those that were made beside others are counted.

    Example:
        >>> runs_in_words(["before", "after", "reference-idm-0123456789ab", "regression-0123456789ab-0000-01234567"])
        'before, after, and 2 made by the software'
    """
    own = [name for name in names if not name.startswith(MADE)]
    made = [f"and {len(names) - len(own)} made by the software"] if len(own) < len(names) else []
    return ", ".join([*own, *made]) or "none"


def _rows(lake: Lake, runs: Sequence[str], where: str, by: str | None, judge: str, given: GivenRuns) -> pl.DataFrame:
    """One row per run and scenario: group, judgement and metrics."""
    columns = ", ".join(f"avg({sql}) AS {name}" for name, sql in METRICS.items())
    group = "'all'" if by is None else f"coalesce(any_value(({by})::VARCHAR), 'unknown')"
    table = tables.load("results")
    listed = [{**row, "run": run} for run, (_, rows) in given.items() for row in rows]
    held = {"given": pa.Table.from_pylist(listed, schema=table.schema)}
    source = f"WITH results AS (SELECT * {table.derived_sql} FROM given)" if given else ""
    query = f"""
        {source}
        SELECT run, scenario_id, {group} AS "group", avg(({judge})::DOUBLE) AS judged, {columns}
        FROM results LEFT JOIN metadata USING (scenario_id)
        WHERE list_contains($runs, run) AND error IS NULL AND ({where})
        GROUP BY run, scenario_id
        ORDER BY scenario_id, run
    """
    return pl.DataFrame(open_view(lake).arrow(query, {"runs": list(runs)}, tables=held))


def _compared(rows: pl.DataFrame, runs: Sequence[str], metric: str, group: str) -> ComparedMetric:
    of_runs = [rows.filter(pl.col("run") == run).select("scenario_id", metric).drop_nulls() for run in runs]
    changes: list[PairedChange | None] = [None]
    for each in of_runs[1:]:
        pairs = of_runs[0].join(each, on="scenario_id", suffix="_then")
        difference = (pairs[f"{metric}_then"] - pairs[metric]).cast(pl.Float64).to_numpy()
        changes.append(
            PairedChange(**asdict(mean_interval(difference)), scenarios=len(difference)) if len(difference) else None
        )
    means = tuple(float(np.mean(each[metric].to_numpy())) if len(each) else None for each in of_runs)
    return ComparedMetric(metric, group, means, tuple(map(len, of_runs)), tuple(changes))
