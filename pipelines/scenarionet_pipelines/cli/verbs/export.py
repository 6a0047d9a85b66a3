"""``scenarionet export``: write a database in the format of another tool."""

from __future__ import annotations

import click

from scenarionet_data.errors import BadParameter
from scenarionet_data.interchange import WRITERS, writer_class
from scenarionet_data.storage.files.places import is_url
from scenarionet_pipelines.cli.execution import worker_facts, worker_rows
from scenarionet_pipelines.cli.output import count, print_json, print_table, size
from scenarionet_pipelines.cli.verb import PARAMETERS, REPLACE, DatabaseVerb, Distributed, argument, option
from scenarionet_pipelines.messages import one_line

_FORMATS = ("scenarionet", *WRITERS)


class ExportVerb(DatabaseVerb, Distributed):
    """Export a database to the folder DIR, or to a URL in an object store.

    The format `scenarionet` is a folder of pickles that ScenarioNet and MetaDrive load unchanged. To read such
    pickles, run `scenarionet convert scenarionet DIR LAKE`. Other formats are files for other simulators; what these
    cannot hold is counted below, and per scenario in DIR/export.jsonl. `-p` sets an option of the format.
    """

    examples = (
        "scenarionet export lake busy_val exported/busy_val --format scenarionet",
        "scenarionet export lake busy_val maps --format pufferdrive -p layout=1",
        "scenarionet export lake busy_val exported/busy_val --workers 4",
        "scenarionet export lake busy_val exported/busy_val --cluster local",
    )
    directory: str = argument("DIR")
    file_format: str = option("Format of the output.", "--format", choices=_FORMATS, default=_FORMATS[0])
    parameters: tuple[str, ...] = PARAMETERS
    workers: int | None = option("Number of processes. [default: 1]", type=click.IntRange(1), metavar="N")
    replace: bool = REPLACE
    current_format: bool = option(
        "Write scenarios that were converted from older pickles in the format of MetaDrive 0.4.3, not as these were."
    )

    def run(self) -> bool:
        from scenarionet_data import ScenarioLoader
        from scenarionet_data.execution.executors import ProcessExecutor
        from scenarionet_data.export import export
        from scenarionet_data.interchange.base import Losses
        from scenarionet_pipelines.cli.converter import parse_fields

        if self.cluster and is_url(self.directory):
            raise BadParameter(
                f"{self.directory}: the workers of a cluster write to a folder that they share; give one, or leave out "
                "--cluster"
            )
        chosen = {}
        if self.file_format != _FORMATS[0]:
            chosen = parse_fields(writer_class(self.file_format), self.file_format, self.parameters)
        elif self.parameters:
            raise BadParameter(f"-p sets options of other formats than {self.file_format}; leave it out")
        with self.execution() as execution, self.progress(f"export {self.database}") as progress:
            report = export(
                ScenarioLoader(self.lake, self.database),
                self.directory,
                replace=self.replace,
                original=not self.current_format,
                file_format=self.file_format,
                parameters=chosen,
                executor=execution.measured or (ProcessExecutor(self.workers) if self.workers else None),
                on_progress=progress.update,
            )
        if self.as_json:
            refused = [{"scenario_id": e.scenario_id, "field": e.field, "reason": e.reason} for e in report.refused]
            written = {"directory": report.directory, "format": self.file_format, "scenarios": report.num_scenarios}
            rest = {"bytes": report.num_bytes, "refused": refused, "losses": Losses(report.losses).as_json()}
            print_json(written | rest | worker_facts(execution.stats))
            return not report.refused
        left_out = f", {len(report.refused):,} left out" if report.refused else ""
        scenarios = count(report.num_scenarios, "scenario")
        click.echo(f"{report.directory}: {scenarios}{left_out}, {size(report.num_bytes)}")
        for loss in report.losses:
            click.echo(f"  {loss}")
        print_table(worker_rows(execution.stats, "part"))
        for error in report.refused:
            click.echo(f"left out: {one_line(error)}", err=True)
        return not report.refused
