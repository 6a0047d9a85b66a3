"""``scenarionet export``: write a database in the format of another tool."""

from __future__ import annotations

from typing import TYPE_CHECKING, cast

import click

from scenarionet_data.errors import BadParameter
from scenarionet_data.interchange import WRITERS, writer_class
from scenarionet_data.storage.files.places import is_url
from scenarionet_pipelines.cli.execution import worker_facts, worker_rows
from scenarionet_pipelines.cli.output import count, size, table
from scenarionet_pipelines.cli.verb import PARAMETERS, REPLACE, Choosing, DatabaseVerb, Distributed, argument, option
from scenarionet_pipelines.messages import one_line

if TYPE_CHECKING:
    from collections.abc import Sequence

    from scenarionet_data import ScenarioDescription
    from scenarionet_data.interchange.base import FormatWriter

_FORMATS = ("scenarionet", *WRITERS)
_WITH_PICTURES = ("mcap", "rerun", "rosbag", "rosbag2")


class ExportVerb(DatabaseVerb, Choosing, Distributed):
    """Export a database to the folder DIR, or to a URL in an object store.

    The format `scenarionet` is a folder of pickles that ScenarioNet and MetaDrive load unchanged. To read such
    pickles, run `scenarionet convert scenarionet DIR LAKE`. Other formats are files for other simulators; what these
    cannot hold is counted below, and per scenario in DIR/export.jsonl. `-p` sets an option of the format.

    With --run, what a run of `scenarionet sim` did goes out instead of the recording, or with --beside its vehicle as
    another object of the recording. `mcap` (Foxglove), `rerun`, `rosbag` and `rosbag2` hold pictures of
    cameras, too (--camera).
    """

    examples = (
        "scenarionet export lake busy_val exported/busy_val --format scenarionet",
        "scenarionet export lake busy_val maps --format pufferdrive -p layout=1",
        "scenarionet export lake busy_val exported/busy_val --workers 4",
        "scenarionet export lake busy_val exported/busy_val --cluster local",
        "scenarionet export lake busy_val viewed --format rerun --run idm --beside --camera chase",
    )
    directory: str = argument("DIR")
    file_format: str = option("Format of the output.", "--format", choices=_FORMATS, default=_FORMATS[0])
    parameters: tuple[str, ...] = PARAMETERS
    workers: int | None = option("Number of processes. [default: 1]", type=click.IntRange(1), metavar="N")
    run_name: str | None = option("Write what this run of `scenarionet sim` did.", "--run", metavar="NAME")
    beside: bool = option("Keep the recording, and add the run's vehicle as an object.")
    cameras: tuple[str, ...] = option(
        "Add the pictures of this view: camera, chase, cockpit or orbit; repeatable.", "--camera", metavar="VIEW"
    )
    picture_size: int = option("Width of the pictures [pixel].", type=click.IntRange(64, 4096), default=640)
    replace: bool = REPLACE
    current_format: bool = option(
        "Write scenarios that were converted from older pickles in the format of MetaDrive 0.4.3, not as these were."
    )

    def run(self) -> bool:
        from scenarionet_data import ScenarioLoader
        from scenarionet_data.execution.executors import ProcessExecutor
        from scenarionet_data.export import export
        from scenarionet_data.interchange import writer_for
        from scenarionet_data.interchange.base import Losses
        from scenarionet_data.scenario.settings import parse_texts
        from scenarionet_pipelines.cli.parameters import pairs

        if self.cluster and is_url(self.directory):
            raise BadParameter(
                f"{self.directory}: the workers of a cluster write to a folder that they share; give one, or leave out "
                "--cluster"
            )
        chosen = {}
        if self.file_format != _FORMATS[0]:
            chosen = parse_texts(writer_class(self.file_format), self.file_format, pairs(self.parameters, "-p"))
        elif self.parameters:
            raise BadParameter(f"-p sets options of other formats than {self.file_format}; leave it out")
        loader = ScenarioLoader(self.lake, self.chosen(self.database))
        scenarios: Sequence[ScenarioDescription] = loader
        if self.run_name is not None:
            from scenarionet_sim.rollouts.driven import DrivenScenarios

            scenarios = DrivenScenarios(loader, self.lake, self.run_name, self.beside)
        elif self.beside:
            raise BadParameter("--beside adds the vehicle of a run; name the run with --run NAME")
        writer: str | FormatWriter = self.file_format
        if self.cameras:
            writer = self.with_pictures(writer_for(self.file_format, chosen))
        with self.execution() as execution, self.progress(f"export {self.database}") as progress:
            report = export(
                scenarios,
                self.directory,
                replace=self.replace,
                original=not self.current_format,
                file_format=writer,
                parameters=chosen,
                executor=execution.measured or (ProcessExecutor(self.workers) if self.workers else None),
                on_progress=progress.update,
            )
        refused = [{"scenario_id": e.scenario_id, "field": e.field, "reason": e.reason} for e in report.refused]
        written = {"directory": report.directory, "format": self.file_format, "scenarios": report.num_scenarios}
        rest = {"bytes": report.num_bytes, "refused": refused, "losses": Losses(report.losses).as_json()}
        left_out = f", {len(report.refused):,} left out" if report.refused else ""
        whole = f"{report.directory}: {count(report.num_scenarios, 'scenario')}{left_out}, {size(report.num_bytes)}"
        lines = [whole, *(f"  {loss}" for loss in report.losses), *table(worker_rows(execution.stats, "part"))]
        self.say(written | rest | worker_facts(execution.stats), lines)
        self.complain((f"left out: {one_line(error)}" for error in report.refused), limit=None)
        return not report.refused

    def with_pictures(self, writer: FormatWriter) -> FormatWriter:
        """Return a writer that adds the pictures of the cameras.

        Raises:
            BadParameter: The format holds no pictures, or a view is unknown.
        """
        from scenarionet_sim.render.pictured import PictureWriter, WithPictures
        from scenarionet_sim.render.space import Film

        if writer.name not in _WITH_PICTURES:
            raise BadParameter(f"{writer.name} holds no pictures; --camera goes with {' and '.join(_WITH_PICTURES)}")
        width, height = self.picture_size // 2 * 2, self.picture_size * 9 // 32 * 2
        return WithPictures(cast("PictureWriter", writer), tuple(Film(view, width, height) for view in self.cameras))
