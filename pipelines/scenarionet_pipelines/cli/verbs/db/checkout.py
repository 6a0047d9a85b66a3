"""``scenarionet db checkout``: restore an earlier version of a database."""

from __future__ import annotations

import click

from scenarionet_pipelines.cli.databases import print_created
from scenarionet_pipelines.cli.group import verb
from scenarionet_pipelines.cli.parameters import json_option, lake_argument


@verb("checkout", "scenarionet db checkout lake busy@1", "scenarionet db checkout lake busy@1 --json")
@lake_argument
@click.argument("database", metavar="DATABASE@VERSION")
@json_option
def command(lake: str, database: str, as_json: bool) -> None:
    """Restore an earlier version of a database as its newest version.

    The versions in between are kept. To only read an earlier version, pass DATABASE@VERSION to any verb.
    """
    from scenarionet_data import Lake

    print_created(Lake(lake).checkout(database), as_json)
