"""``scenarionet maintain check``: check scenarios against the quality rules."""

from __future__ import annotations

from dataclasses import asdict
from typing import TYPE_CHECKING, Any

import click

from scenarionet_data.errors import BadParameter
from scenarionet_pipelines.cli.advice import one_line
from scenarionet_pipelines.cli.execution import executor_from_options, worker_facts, worker_rows
from scenarionet_pipelines.cli.group import verb
from scenarionet_pipelines.cli.output import count, print_json, print_table
from scenarionet_pipelines.cli.parameters import (
    cluster_option,
    json_option,
    lake_argument,
    new_version_option,
    optional_database_argument,
    quiet_option,
    snapshot_option,
    workers_option,
)
from scenarionet_pipelines.cli.progress import ProgressDisplay
from scenarionet_pipelines.cli.table_file import check_suffix, write_table

if TYPE_CHECKING:
    from scenarionet_data import Lake
    from scenarionet_data.databases.record import DatabaseRecord
    from scenarionet_data.execution.executors import Executor
    from scenarionet_data.quality.report import CheckReport, CheckResult
    from scenarionet_data.quality.scorecard import PartitionScore, Scorecard

_REPLAYS = "The ego of every recording reaches its destination when replayed."


@verb(
    "check",
    "scenarionet maintain check lake",
    "scenarionet maintain check lake busy --only ids_are_unique --only nobody_teleports",
    "scenarionet maintain check lake --scorecard -o scorecard.csv",
    "scenarionet maintain check lake busy --name good --broken broken.parquet",
    "scenarionet maintain check lake --strict --json",
    "scenarionet maintain check lake busy --simulate --workers 4",
    "scenarionet maintain check lake --scorecard --cluster local",
)
@lake_argument
@optional_database_argument
@click.option("--only", multiple=True, metavar="NAME", help="Run only this check; repeatable.")
@click.option("--strict", is_flag=True, help="Treat plausibility rules like structural ones.")
@click.option(
    "--scorecard",
    is_flag=True,
    help="Report by dataset, version and split, and compare with published scenario counts.",
)
@click.option("-o", "--output", metavar="FILE", help="Write the scorecard to a .parquet, .csv or .json file.")
@click.option(
    "--name", metavar="NAME", help="Save the scenarios that pass as a database (with --strict: pass every rule)."
)
@new_version_option
@click.option("--broken", metavar="FILE", help="Write the violations to a .parquet, .csv or .json file.")
@click.option("--simulate", is_flag=True, help="Also replay every scenario in the simulator.")
@workers_option
@cluster_option
@snapshot_option
@json_option
@quiet_option
def command(
    lake: str,
    database: str | None,
    only: tuple[str, ...],
    strict: bool,
    scorecard: bool,
    output: str | None,
    name: str | None,
    replace: bool,
    broken: str | None,
    simulate: bool,
    workers: int | None,
    cluster: str | None,
    snapshot: int | None,
    as_json: bool,
    quiet: bool,
) -> None:
    """Check the scenarios of a lake, or of a database, against the quality rules.

    The rules are SQL files in sql/checks. Hard rules are structural and also checked during conversion; scenarios
    that violate one cannot be trusted. Soft rules test whether recorded motion is plausible. Real recordings violate
    some of them: each dataset has budgets, and a share of its scenarios may exceed them. Soft rules fail the command
    only with --strict.

    --simulate also replays every recording in the simulator; a scenario whose ego does not reach its destination
    fails. --scorecard reports the violations of each rule by split, and the share of the published scenarios that
    the lake contains. --name saves the scenarios that pass, --broken writes the violations with rule and reason.
    """
    from scenarionet_data import Lake
    from scenarionet_data.quality.checks import run_checks
    from scenarionet_data.quality.passing import save_passing
    from scenarionet_data.quality.scorecard import make_scorecard

    _check_outputs(output, broken, scorecard)
    opened = Lake(lake, snapshot)
    with executor_from_options(cluster, workers, quiet=quiet) as execution:
        with ProgressDisplay(f"check {lake}", "check", is_quiet=quiet) as progress:
            findings = run_checks(
                opened, database, only or None, on_progress=progress.update, executor=execution.measured
            )
        if simulate:
            findings = findings.with_check(
                "replays", _REPLAYS, _simulate(opened, database, workers, execution.measured, quiet)
            )
    card = make_scorecard(findings) if scorecard else None
    made = save_passing(findings, name, strict=strict, replace=replace) if name else None
    if broken:
        _write(findings.rows, broken)
    if card and output:
        _write(card.rows, output)
    has_failed = any(not result.is_met and (result.is_hard or strict) for result in findings.results)
    if as_json:
        print_json(_content(findings, card, made) | {"is_ok": not has_failed} | worker_facts(execution.stats))
    else:
        _print(findings, card, made)
        print_table(worker_rows(execution.stats, "part"))
    click.get_current_context().exit(1 if has_failed else 0)


def _simulate(
    lake: Lake, database: str | None, workers: int | None, executor: Executor | None, quiet: bool
) -> list[tuple[str, str]]:
    from scenarionet_pipelines.machine import default_workers
    from scenarionet_sim.evaluation.evaluation import find_broken

    with ProgressDisplay("simulate", "part", is_quiet=quiet) as progress:
        processes = workers or default_workers()
        return find_broken(lake, database, workers=processes, executor=executor, on_progress=progress.update)


def _check_outputs(output: str | None, broken: str | None, scorecard: bool) -> None:
    """Raise for output options that cannot be used, before anything is checked."""
    if output and not scorecard:
        raise BadParameter("-o writes the scorecard: add --scorecard, or use --broken FILE to write the violations")
    for path, option in ((output, "-o"), (broken, "--broken")):
        if path:
            check_suffix(path, option)


def _write(rows: Any, path: str) -> None:
    import polars

    table = polars.DataFrame(rows)
    write_table(table, path)
    click.echo(f"{count(len(table), 'row')} in {path}", err=True)


def _content(findings: CheckReport, card: Scorecard | None, made: DatabaseRecord | None) -> dict[str, Any]:
    content: dict[str, Any] = {"checks": [asdict(result) for result in findings.results]}
    if card:
        content["scorecard"] = card.to_dict()
    if made:
        content["good"] = {"reference": made.reference} | asdict(made.lineage)
    return content


# --- tables -----------------------------------------------------------------------------------------------


def _print(findings: CheckReport, card: Scorecard | None, made: DatabaseRecord | None) -> None:
    if card:
        _print_card(card)
    else:
        print_table((_mark(result), result.name, result.doc) for result in findings.results)
        for result in findings.results:
            _print_examples(result)
    if made:
        total = sum(findings.totals["scenarios"].to_pylist())
        click.echo(f"\n{made.reference}: {len(made):,} of {count(total, 'scenario')}")


def _print_examples(result: CheckResult) -> None:
    if not result.examples:
        return
    broken = [count(result.num_scenarios, "scenario")] if result.num_scenarios else []
    broken += [count(result.num_others, "map or shard").replace("shards", "shard")] if result.num_others else []
    within = ", within the budget" if result.is_met else ""
    click.echo(f"\n{result.name}: {' and '.join(broken)}{within}, for example")
    print_table(("", scenario_id or "-", detail) for scenario_id, detail in result.examples)


def _mark(result: CheckResult) -> str:
    return _word(result.is_met, result.is_hard)


def _word(is_met: bool, is_hard: bool) -> str:
    if is_met:
        return "ok"
    return "FAILED" if is_hard else "doubtful"


def _print_card(card: Scorecard) -> None:
    for number, partition in enumerate(card.partitions):
        click.echo(("\n" if number else "") + "/".join((partition.dataset, partition.version, partition.split)))
        print_table(_facts(partition))
        print_table(
            (
                "",
                _word(mark.is_met, mark.is_hard),
                mark.check,
                mark.broken,
                f"{mark.share:.2%}",
                one_line(": ".join(mark.examples[0])) if mark.examples else "",
            )
            for mark in partition.rules
        )
    for check, detail in card.others:
        click.echo(f"\n{check}: {detail}")


def _facts(partition: PartitionScore) -> list[tuple[str, str, str]]:
    found = f"{count(partition.scenarios, 'scenario')}, {partition.quarantined:,} in quarantine"
    budgets = ", ".join(f"{name} {value:g}" for name, value in asdict(partition.budgets).items())
    coverage = partition.coverage
    published = f"{coverage.text} ({coverage.release.source})" if coverage else "no published counts for this split"
    return [("", "holds", found), ("", "split", published), ("", "budgets", budgets)]
