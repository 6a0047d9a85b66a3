"""``scenarionet export``: write a database in the format of another tool."""

from __future__ import annotations

import click

from scenarionet_data.errors import BadParameter
from scenarionet_data.interchange import WRITERS, writer_class
from scenarionet_data.storage.files.places import is_url
from scenarionet_pipelines.cli.advice import one_line
from scenarionet_pipelines.cli.execution import executor_from_options, worker_facts, worker_rows
from scenarionet_pipelines.cli.group import verb
from scenarionet_pipelines.cli.output import count, print_json, print_table, size
from scenarionet_pipelines.cli.parameters import (
    cluster_option,
    database_argument,
    json_option,
    lake_argument,
    parameter_option,
    quiet_option,
    replace_option,
)
from scenarionet_pipelines.cli.progress import ProgressDisplay

_FORMATS = ("scenarionet", *WRITERS)


@verb(
    "export",
    "scenarionet export lake busy_val exported/busy_val --format scenarionet",
    "scenarionet export lake busy_val maps --format pufferdrive -p layout=1",
    "scenarionet export lake busy_val exported/busy_val --workers 4",
    "scenarionet export lake busy_val exported/busy_val --cluster local",
)
@lake_argument
@database_argument
@click.argument("directory", metavar="DIR")
@click.option("--format", "file_format", type=click.Choice(_FORMATS), default=_FORMATS[0], help="Format of the output.")
@parameter_option
@click.option("--workers", type=click.IntRange(1), metavar="N", help="Number of processes. [default: 1]")
@cluster_option
@replace_option
@click.option(
    "--current-format",
    is_flag=True,
    help="Write scenarios that were converted from older pickles in the format of MetaDrive 0.4.3, not as these were.",
)
@json_option
@quiet_option
def command(
    lake: str,
    database: str,
    directory: str,
    file_format: str,
    parameters: tuple[str, ...],
    workers: int | None,
    cluster: str | None,
    replace: bool,
    current_format: bool,
    as_json: bool,
    quiet: bool,
) -> None:
    """Export a database to the folder DIR, or to a URL in an object store.

    The format `scenarionet` is a folder of pickles that ScenarioNet and MetaDrive load unchanged. To read such
    pickles, run `scenarionet convert scenarionet DIR LAKE`. Other formats are files for other simulators; what these
    cannot hold is counted below, and per scenario in DIR/export.jsonl. `-p` sets an option of the format.
    """
    from scenarionet_data import ScenarioLoader
    from scenarionet_data.execution.executors import ProcessExecutor
    from scenarionet_data.export import export
    from scenarionet_data.interchange.base import Losses
    from scenarionet_pipelines.cli.converter import parse_fields

    if cluster and is_url(directory):
        raise BadParameter(
            f"{directory}: the workers of a cluster write to a folder that they share; give one, or leave out --cluster"
        )
    if file_format != _FORMATS[0]:
        chosen = parse_fields(writer_class(file_format), file_format, parameters)
    elif parameters:
        raise BadParameter(f"-p sets options of other formats than {file_format}; leave it out")
    else:
        chosen = {}
    scenarios = ScenarioLoader(lake, database)
    with (
        executor_from_options(cluster, workers, quiet=quiet) as execution,
        ProgressDisplay(f"export {database}", is_quiet=quiet) as progress,
    ):
        report = export(
            scenarios,
            directory,
            replace=replace,
            original=not current_format,
            file_format=file_format,
            parameters=chosen,
            executor=execution.measured or (ProcessExecutor(workers) if workers else None),
            on_progress=progress.update,
        )
    if as_json:
        refused = [{"scenario_id": e.scenario_id, "field": e.field, "reason": e.reason} for e in report.refused]
        written = {"scenarios": report.num_scenarios, "bytes": report.num_bytes}
        print_json(
            {"directory": report.directory, "format": file_format}
            | written
            | {"refused": refused, "losses": Losses(report.losses).as_json()}
            | worker_facts(execution.stats)
        )
    else:
        left_out = f", {len(report.refused):,} left out" if report.refused else ""
        scenarios_written = count(report.num_scenarios, "scenario")
        click.echo(f"{report.directory}: {scenarios_written}{left_out}, {size(report.num_bytes)}")
        for loss in report.losses:
            click.echo(f"  {loss}")
        print_table(worker_rows(execution.stats, "part"))
        for error in report.refused:
            click.echo(f"left out: {one_line(error)}", err=True)
    click.get_current_context().exit(1 if report.refused else 0)
