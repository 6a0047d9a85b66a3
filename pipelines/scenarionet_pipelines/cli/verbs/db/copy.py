"""``scenarionet db copy``: save a database under another name."""

from __future__ import annotations

import click

from scenarionet_pipelines.cli.databases import print_created
from scenarionet_pipelines.cli.group import verb
from scenarionet_pipelines.cli.parameters import database_argument, json_option, lake_argument, new_version_option


@verb("copy", "scenarionet db copy lake busy paper_train", "scenarionet db copy lake busy@1 busy_then --json")
@lake_argument
@database_argument
@click.argument("name", metavar="NAME")
@new_version_option
@json_option
def command(lake: str, database: str, name: str, replace: bool, as_json: bool) -> None:
    """Copy a database, or one of its versions (DATABASE@VERSION), to a new name.

    Only the list of scenarios is copied. Later changes of DATABASE do not affect the copy.
    """
    from scenarionet_data import Lake

    print_created(Lake(lake).copy(database, name=name, replace=replace), as_json)
