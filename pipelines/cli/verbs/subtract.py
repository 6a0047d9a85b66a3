"""``scenarionet subtract``: who is in one database and in no other."""

from __future__ import annotations

import click

from pipelines.cli.databases import print_made
from pipelines.cli.group import verb
from pipelines.cli.parameters import allow_empty_option, json_option, lake_argument, new_version_option, to_option


@verb("subtract", "scenarionet subtract lake busy seen --to unseen", "scenarionet subtract lake a b c --to rest")
@lake_argument
@click.argument("databases", metavar="DB...", nargs=-1, required=True)
@to_option
@new_version_option
@allow_empty_option
@json_option
def command(lake: str, databases: tuple[str, ...], name: str, replace: bool, allow_empty: bool, as_json: bool) -> None:
    """Save the scenarios of the first database that are in none of the others, in its order."""
    from scenarionet_data import Lake

    opened = Lake(lake)
    made = opened.subtract(databases, name=name, replace=replace, allow_empty=allow_empty)
    print_made(made, as_json, len(opened.database(databases[0])))
