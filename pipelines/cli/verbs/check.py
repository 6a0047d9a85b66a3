"""``scenarionet check``: whether a lake's content satisfies the rules."""

from __future__ import annotations

from dataclasses import asdict
from typing import TYPE_CHECKING

import click

from pipelines.cli.group import verb
from pipelines.cli.output import count, print_json, print_table
from pipelines.cli.parameters import json_option, lake_argument, quiet_option, snapshot_option
from pipelines.cli.progress import Progress

if TYPE_CHECKING:
    from scenarionet_data import Lake
    from scenarionet_data.catalog.checks import CheckResult


@verb(
    "check",
    "scenarionet check lake",
    "scenarionet check lake busy --only ids_are_unique --only nobody_teleports",
    "scenarionet check lake --strict --json",
    "scenarionet check lake busy --simulate --workers 4",
)
@lake_argument
@click.argument("database", metavar="DB", required=False)
@click.option("--only", multiple=True, metavar="NAME", help="Run this check and no others; repeatable.")
@click.option("--strict", is_flag=True, help="Let plausibility count like structure.")
@click.option("--simulate", is_flag=True, help="Replay every scenario in the simulator too; names the broken ones.")
@click.option("--workers", type=click.IntRange(1), help="Processes that simulate; one a core unless given.")
@snapshot_option
@json_option
@quiet_option
def command(
    lake: str,
    database: str | None,
    only: tuple[str, ...],
    strict: bool,
    simulate: bool,
    workers: int | None,
    snapshot: int | None,
    as_json: bool,
    quiet: bool,
) -> None:
    """Check a lake, or a database of it, rule by rule.

    The rules are files in sql/checks. Hard ones are structural: scenarios that break them cannot be trusted.
    Soft ones ask whether recorded motion is plausible, and recordings break them now and then; they are reported,
    and fail the command with --strict only.
    """
    from scenarionet_data import Lake
    from scenarionet_data.catalog.checks import run_checks

    results = run_checks(Lake(lake, snapshot), database, only or None)
    if simulate:
        results.insert(0, _simulated(Lake(lake, snapshot), database, workers, quiet))
    has_failed = any(not result.is_met and (result.is_hard or strict) for result in results)
    if as_json:
        checks = [asdict(result) | {"is_met": result.is_met} for result in results]
        print_json({"checks": checks, "is_ok": not has_failed})
    else:
        _print(results)
    click.get_current_context().exit(1 if has_failed else 0)


def _simulated(lake: Lake, database: str | None, workers: int | None, quiet: bool) -> CheckResult:
    from pipelines.machine import default_workers
    from scenarionet_data.catalog.checks import NUM_EXAMPLES, CheckResult
    from scenarionet_sim.evaluation import find_broken

    with Progress("simulate", "part", is_quiet=quiet) as progress:
        broken = find_broken(lake, database, workers=workers or default_workers(), on_progress=progress.update)
    rule = "Every recording replays to its destination."
    return CheckResult("replays", rule, True, len(broken), tuple(broken[:NUM_EXAMPLES]))


def _print(results: list[CheckResult]) -> None:
    print_table((_mark(result), result.name, result.doc) for result in results)
    for result in results:
        if not result.is_met:
            click.echo(f"\n{result.name}: {count(result.num_scenarios, 'scenario')}, for example")
            print_table(("", scenario_id, detail) for scenario_id, detail in result.examples)


def _mark(result: CheckResult) -> str:
    if result.is_met:
        return "ok"
    return "FAILED" if result.is_hard else "doubtful"
