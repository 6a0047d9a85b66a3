"""``scenarionet runs compare``: compare the results of runs of ``scenarionet sim``."""

from __future__ import annotations

from dataclasses import asdict
from typing import TYPE_CHECKING, Any

import click

from scenarionet_pipelines.cli.group import verb
from scenarionet_pipelines.cli.output import count, print_json, print_table
from scenarionet_pipelines.cli.parameters import json_option, lake_argument

if TYPE_CHECKING:
    from scenarionet_data import Lake
    from scenarionet_sim.evaluation.comparison import RunComparison


@verb(
    "compare",
    "scenarionet runs compare lake val-idm-replay-kinematic val-constant-replay-kinematic",
    "scenarionet runs compare lake before after --by dataset --worse got_worse --html comparison.html",
    "scenarionet runs compare lake before after --event cut_in --where 'num_vehicles > 10' --json",
    "scenarionet runs compare lake before after --fail-if 'crashed > 0.01 OR nuplan_score_change < -0.02'",
)
@lake_argument
@click.argument("runs", nargs=-1, required=True, metavar="RUN RUN...")
@click.option("--where", default="true", metavar="SQL", help="Only scenarios that satisfy this over results, metadata.")
@click.option("--by", metavar="SQL", help="Group the scenarios by this expression, for example dataset.")
@click.option("--event", metavar="EVENT", help="Group the scenarios by whether this event happens, for example cut_in.")
@click.option("--judge", metavar="SQL", help="What makes a scenario better, if higher. [default: nuPlan's score]")
@click.option("--better", metavar="NAME", help="Save the scenarios that got better as a database.")
@click.option("--worse", metavar="NAME", help="Save the scenarios that got worse as a database.")
@click.option("--html", metavar="FILE", help="Write a page with pictures of the scenarios that got worst.")
@click.option("--fail-if", metavar="SQL", help="Exit with 1 if it holds for the last run, as 'crashed > 0.01'.")
@json_option
@click.pass_context
def command(
    context: click.Context,
    lake: str,
    runs: tuple[str, ...],
    where: str,
    by: str | None,
    event: str | None,
    judge: str | None,
    better: str | None,
    worse: str | None,
    html: str | None,
    fail_if: str | None,
    as_json: bool,
) -> None:
    """Compare two or more runs of `scenarionet sim`.

    For every metric there are the share of scenarios or the mean of each run with its number of scenarios, and the
    mean difference from the first run over the scenarios that both have, with a 95 % interval by bootstrapping.

    --fail-if is an SQL expression over the names of the metrics, the values of the last run, and the same names with
    _change.
    """
    from scenarionet_data import Lake
    from scenarionet_sim.evaluation.comparison import JUDGED_BY, compare_runs

    opened = Lake(lake)
    found = compare_runs(opened, *runs, where=where, by=by, event=event, judged_by=judge or JUDGED_BY)
    for name, changed in ((better, found.better), (worse, found.worse)):
        if name is not None:
            _save(opened, name, [scenario_id for scenario_id, _ in changed])
    if html:
        from scenarionet_pipelines.report.runs_page import write

        write(found, opened, html)
        click.echo(f"wrote {html}", err=True)
    failed = fail_if is not None and found.holds(fail_if, opened)
    if as_json:
        print_json(asdict(found) | {"failed": failed})
    else:
        _print(found)
    if failed:
        click.echo(f"failed: {fail_if} holds for {found.runs[-1]}", err=True)
        context.exit(1)


def _save(lake: Lake, name: str, ids: list[str]) -> None:
    """Save scenarios as a database; without any there is none."""
    if not ids:
        click.echo(f"no scenario for the database {name}, which is not made", err=True)
        return
    saved = lake.filter(ids=ids, name=name, replace=True)
    click.echo(f"saved {saved.reference} with {count(len(saved), 'scenario')}", err=True)


def _print(found: RunComparison) -> None:
    from scenarionet_pipelines.report.changes import change_text

    has_groups = len({each.group for each in found.metrics}) > 1
    heads = ["group"] * has_groups + ["", *found.runs, *(f"change to {run}" for run in found.runs[1:])]
    rows: list[list[Any]] = []
    for each in found.metrics:
        if not any(each.scenarios):
            continue
        means = [
            f"{m:.4g} (n = {n:,})" if m is not None else "-" for m, n in zip(each.means, each.scenarios, strict=True)
        ]
        rows.append([each.group] * has_groups + [each.metric, *means, *map(change_text, each.changes[1:])])
    print_table(rows, heads)
    for note in found.notes:
        click.echo(f"note: {note}")
    verdict = f"{count(len(found.better), 'scenario')} better, {len(found.worse):,} worse in {found.runs[-1]}"
    click.echo(f"{verdict} by {found.judged_by}")
