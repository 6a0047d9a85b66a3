"""``scenarionet runs compare``: compare the results of runs of ``scenarionet sim``."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import asdict
from typing import TYPE_CHECKING, Any

import click

from scenarionet_pipelines.cli.output import count, table
from scenarionet_pipelines.cli.verb import LakeVerb, argument, option

if TYPE_CHECKING:
    from scenarionet_sim.evaluation.comparison import RunComparison

_WORST = 10
"""Scenarios that got worse and are listed."""


class CompareVerb(LakeVerb):
    """Compare two or more runs of `scenarionet sim`.

    For every metric there are the share of scenarios or the mean of each run with its number of scenarios, and the
    mean difference from the first run over the scenarios that both have, with a 95 % interval of Student's t. Then come
    the scenarios that got worst, and a verdict on the last run: the metrics whose interval is on one side of 0.

    --fail-if is an SQL expression over the names of the metrics, the values of the last run, and the same names with
    _change.
    """

    examples = (
        "scenarionet runs compare lake val-idm-replay-kinematic val-constant-replay-kinematic",
        "scenarionet runs compare lake before after --by dataset --worse got_worse --html comparison.html",
        "scenarionet runs compare lake before after --event cut_in --where 'num_vehicles > 10' --json",
        "scenarionet runs compare lake before after --fail-if 'crashed > 0.01 OR nuplan_score_change < -0.02'",
    )
    runs: tuple[str, ...] = argument("RUN RUN...", required=True)
    where: str = option("Only scenarios that satisfy this over results, metadata.", default="true", metavar="SQL")
    by: str | None = option("Group the scenarios by this expression, for example dataset.", metavar="SQL")
    event: str | None = option(
        "Group the scenarios by whether this event happens, for example cut_in.", metavar="EVENT"
    )
    judge: str | None = option("What makes a scenario better, if higher. [default: nuPlan's score]", metavar="SQL")
    better: str | None = option("Save the scenarios that got better as a database.", metavar="NAME")
    worse: str | None = option("Save the scenarios that got worse as a database.", metavar="NAME")
    html: str | None = option("Write a page with pictures of the scenarios that got worst.", metavar="FILE")
    receipt: str | None = option("Write a receipt, with those of the runs, for `runs verify`.", metavar="FILE")
    fail_if: str | None = option("Exit with 1 if it holds for the last run, as 'crashed > 0.01'.", metavar="SQL")

    def run(self) -> bool:
        from scenarionet_sim.evaluation.comparison import JUDGED_BY, compare_runs

        opened, judged_by = self.open(), self.judge or JUDGED_BY
        asked: dict[str, Any] = {"where": self.where, "by": self.by, "event": self.event, "judged_by": judged_by}
        found = compare_runs(opened, *self.runs, **asked)
        if self.receipt:
            from scenarionet_sim.evaluation.score_receipts import score_receipt

            score_receipt(opened, "comparison", found, {"runs": list(self.runs), **asked}).write(self.receipt)
        for name, changed in ((self.better, found.better), (self.worse, found.worse)):
            if name is not None and changed:
                saved = opened.filter(ids=[scenario_id for scenario_id, _ in changed], name=name, replace=True)
                click.echo(f"saved {saved.reference} with {count(len(saved), 'scenario')}", err=True)
            elif name is not None:
                click.echo(f"no scenario for the database {name}, which is not made", err=True)
        if self.html:
            from scenarionet_pipelines.report.runs_page import write

            write(found, opened, self.html)
            click.echo(f"wrote {self.html}", err=True)
        failed = self.fail_if is not None and found.holds(self.fail_if, opened)
        worse, better, measures = found.verdict()
        verdict = {"worse": worse, "better": better, "measures": measures}
        self.say(asdict(found) | {"failed": failed, "verdict": verdict}, comparison_lines(found))
        if failed:
            click.echo(f"failed: {self.fail_if} holds for {found.runs[-1]}", err=True)
        return not failed


def comparison_lines(found: RunComparison) -> Iterator[str]:
    """Yield the mean of each metric by run and group, the scenarios that got worst, and the verdict."""
    from scenarionet_pipelines.report.changes import change_text, mean_text

    has_groups = len({each.group for each in found.metrics}) > 1
    heads = ["group"] * has_groups + ["", *found.runs, *(f"change to {run}" for run in found.runs[1:])]
    rows: list[list[Any]] = []
    for each in found.metrics:
        if not any(each.scenarios):
            continue
        means = map(mean_text, each.means, each.scenarios)
        rows.append([each.group] * has_groups + [each.metric, *means, *map(change_text, each.changes[1:])])
    yield from table(rows, heads)
    yield from (f"note: {note}" for note in found.notes)
    last = found.runs[-1]
    changed = f"{count(len(found.better), 'scenario')} better, {len(found.worse):,} worse in {last}"
    yield f"{changed} by {found.judged_by}"
    yield from table([(scenario_id, f"{change:+.4g}") for scenario_id, change in found.worse[:_WORST]])
    worse, better, measures = found.verdict()
    for word, metrics in (("better", better), ("worse", worse)):
        named = f": {', '.join(metrics)}" if metrics else ""
        yield f"{last} is significantly {word} in {len(metrics)} of {count(measures, 'measure')}{named}"
