"""``scenarionet db rename``: rename a database."""

from __future__ import annotations

import click

from scenarionet_pipelines.cli.group import verb
from scenarionet_pipelines.cli.output import print_json
from scenarionet_pipelines.cli.parameters import database_argument, json_option, lake_argument


@verb("rename", "scenarionet db rename lake busy crowded", "scenarionet db rename lake tmp train --json")
@lake_argument
@database_argument
@click.argument("name", metavar="NAME")
@json_option
def command(lake: str, database: str, name: str, as_json: bool) -> None:
    """Rename a database with all its versions.

    Refused if other databases were made from it, because their lineage refers to its name.
    """
    from scenarionet_data import Lake

    Lake(lake).rename(database, name=name)
    if as_json:
        print_json({"before": database, "name": name})
    else:
        click.echo(f"{database} -> {name}")
