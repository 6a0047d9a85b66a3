"""``scenarionet checkout``: an old version of a database, made the newest again."""

from __future__ import annotations

import click

from scenarionet_pipelines.cli.databases import print_made
from scenarionet_pipelines.cli.group import verb
from scenarionet_pipelines.cli.parameters import json_option, lake_argument


@verb("checkout", "scenarionet checkout lake busy@1", "scenarionet checkout lake busy@1 --json")
@lake_argument
@click.argument("database", metavar="DB@VERSION")
@json_option
def command(lake: str, database: str, as_json: bool) -> None:
    """Make an old version of a database its newest again. The versions between stay.

    To only read an old version, write DB@VERSION wherever a database is asked for.
    """
    from scenarionet_data import Lake

    print_made(Lake(lake).checkout(database), as_json)
