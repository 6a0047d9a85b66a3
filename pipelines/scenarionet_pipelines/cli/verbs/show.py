"""``scenarionet show``: show the metadata of one scenario."""

from __future__ import annotations

import click

from scenarionet_pipelines.cli.output import table
from scenarionet_pipelines.cli.parameters import output_path
from scenarionet_pipelines.cli.verb import REPLACE, SNAPSHOT, LakeVerb, argument, option


class ShowVerb(LakeVerb):
    """Show the metadata of one scenario with units, and optionally draw it.

    ID is the id of the scenario or any part of it that is unique in the lake. The picture shows the current timestep
    and requires the extra `plots`; `scenarionet render` draws other timesteps and videos.
    """

    examples = (
        "scenarionet show lake waymo/v1.2/637f20cafde22ff8",
        "scenarionet show lake 637f20caf --json",
        "scenarionet show lake 637f20caf --picture scenario.png",
    )
    scenario_id: str = argument("ID")
    picture: str | None = option("Also draw it to a .png, .svg or .pdf file.", metavar="FILE")
    snapshot: int | None = SNAPSHOT
    replace: bool = REPLACE

    def run(self) -> None:
        from scenarionet_data.schema import tables

        opened = self.open_view()
        facts = opened.describe(self.scenario_id)
        if self.picture:
            from scenarionet_data import ScenarioLoader
            from scenarionet_data.plots import scenario_figure, write_figure

            path = output_path(self.picture, "a picture", replace=self.replace)
            write_figure(path, scenario_figure(ScenarioLoader(opened, [facts["scenario_id"]])[0]))
            click.echo(f"wrote {self.picture}", err=True)
        metadata = tables.load("metadata")
        units = {column.name: column.unit for column in (*metadata.columns, *metadata.derived)}
        rows = [(name, value, units.get(name, "")) for name, value in facts.items() if value is not None]
        self.say(facts, table(rows, max_cell=100))
