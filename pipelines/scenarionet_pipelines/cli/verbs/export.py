"""``scenarionet export``: a database in a format of other tools."""

from __future__ import annotations

from pathlib import Path

import click

from scenarionet_pipelines.cli.execution import executor_from_options, worker_facts, worker_rows
from scenarionet_pipelines.cli.group import one_line, verb
from scenarionet_pipelines.cli.output import count, print_json, print_table, size
from scenarionet_pipelines.cli.parameters import (
    cluster_option,
    json_option,
    lake_argument,
    quiet_option,
    replace_option,
)
from scenarionet_pipelines.cli.progress import ProgressDisplay

_FORMATS = ("scenarionet",)


@verb(
    "export",
    "scenarionet export lake busy_val exported/busy_val --format scenarionet",
    "scenarionet export lake busy_val exported/busy_val --workers 4",
    "scenarionet export lake busy_val exported/busy_val --cluster local",
)
@lake_argument
@click.argument("database", metavar="DB")
@click.argument("directory", metavar="DIR")
@click.option("--format", "to", type=click.Choice(_FORMATS), default=_FORMATS[0], help="Whose pickles to write.")
@click.option("--workers", type=click.IntRange(1), help="Processes; one unless given.")
@cluster_option
@replace_option
@json_option
@quiet_option
def command(
    lake: str,
    database: str,
    directory: str,
    to: str,
    workers: int | None,
    cluster: str | None,
    replace: bool,
    as_json: bool,
    quiet: bool,
) -> None:
    """Write a database's scenarios to DIR.

    `scenarionet` writes the pickles that ScenarioNet and MetaDrive load unchanged; `scenarionet convert
    scenarionet DIR LAKE` reads such pickles.
    """
    from scenarionet_data import ScenarioLoader
    from scenarionet_data.execution.executors import ProcessExecutor
    from scenarionet_data.export import export

    scenarios = ScenarioLoader(lake, database)
    with (
        executor_from_options(cluster, workers, quiet=quiet) as execution,
        ProgressDisplay(f"export {database}", is_quiet=quiet) as progress,
    ):
        report = export(
            scenarios,
            Path(directory).resolve(),
            replace=replace,
            executor=execution.measured or (ProcessExecutor(workers) if workers else None),
            on_progress=progress.update,
        )
    if as_json:
        refused = [{"scenario_id": e.scenario_id, "field": e.field, "reason": e.reason} for e in report.refused]
        written = {"scenarios": report.num_scenarios, "bytes": report.num_bytes}
        print_json(
            {"directory": report.directory, "format": to}
            | written
            | {"refused": refused}
            | worker_facts(execution.stats)
        )
    else:
        click.echo(f"{report.directory}: {count(report.num_scenarios, 'scenario')}, {size(report.num_bytes)}")
        print_table(worker_rows(execution.stats, "part"))
        for error in report.refused:
            click.echo(f"left out: {one_line(error)}", err=True)
    click.get_current_context().exit(1 if report.refused else 0)
