"""``scenarionet show``: show the metadata of one scenario."""

from __future__ import annotations

from typing import TYPE_CHECKING

import click

from scenarionet_data.errors import BadParameter
from scenarionet_pipelines.cli.group import verb
from scenarionet_pipelines.cli.output import print_json, print_table
from scenarionet_pipelines.cli.parameters import json_option, lake_argument, replace_option, snapshot_option

if TYPE_CHECKING:
    from scenarionet_data import Lake


@verb(
    "show",
    "scenarionet show lake waymo/v1.2/637f20cafde22ff8",
    "scenarionet show lake 637f20caf --json",
    "scenarionet show lake 637f20caf --picture scenario.png",
)
@lake_argument
@click.argument("scenario_id", metavar="ID")
@click.option(
    "--picture", type=click.Path(dir_okay=False), metavar="FILE", help="Also draw it to a .png, .svg or .pdf file."
)
@snapshot_option
@replace_option
@json_option
def command(
    lake: str, scenario_id: str, picture: str | None, snapshot: int | None, replace: bool, as_json: bool
) -> None:
    """Show the metadata of one scenario with units, and optionally draw it.

    ID is the id of the scenario or any part of it that is unique in the lake. The picture shows the current timestep
    and requires the extra `plots`; `scenarionet render` draws other timesteps and videos.
    """
    from scenarionet_data import Lake
    from scenarionet_data.schema import tables

    opened = Lake(lake, snapshot)
    facts = opened.describe(scenario_id)
    if picture:
        _draw(opened, facts["scenario_id"], picture, replace=replace)
        click.echo(f"wrote {picture}", err=True)
    if as_json:
        print_json(facts)
        return
    metadata = tables.load("metadata")
    units = {column.name: column.unit for column in (*metadata.columns, *metadata.derived)}
    rows = [(name, value, units.get(name, "")) for name, value in facts.items() if value is not None]
    print_table(rows, max_cell=100)


def _draw(lake: Lake, scenario_id: str, picture: str, *, replace: bool) -> None:
    from scenarionet_data import ScenarioLoader
    from scenarionet_data.plots import scenario_figure, write_figure
    from scenarionet_data.storage.files.places import local_path

    if local_path(picture, "a picture").exists() and not replace:
        raise BadParameter(f"{picture} exists; choose another name, or --replace")
    write_figure(picture, scenario_figure(ScenarioLoader(lake, [scenario_id])[0]))
