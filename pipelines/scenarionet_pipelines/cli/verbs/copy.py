"""``scenarionet copy``: a database under another name."""

from __future__ import annotations

import click

from scenarionet_pipelines.cli.databases import print_made
from scenarionet_pipelines.cli.group import verb
from scenarionet_pipelines.cli.parameters import json_option, lake_argument, new_version_option


@verb("copy", "scenarionet copy lake busy paper_train", "scenarionet copy lake busy@1 busy_then --json")
@lake_argument
@click.argument("database", metavar="DB")
@click.argument("name", metavar="NAME")
@new_version_option
@json_option
def command(lake: str, database: str, name: str, replace: bool, as_json: bool) -> None:
    """Save a database (or its old version DB@VERSION) under another name too.

    The copy stays as it is, whatever becomes of DB. No scenario is copied.
    """
    from scenarionet_data import Lake

    print_made(Lake(lake).copy(database, name=name, replace=replace), as_json)
