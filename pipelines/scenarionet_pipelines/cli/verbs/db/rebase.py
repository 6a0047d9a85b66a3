"""``scenarionet db rebase``: update a database to the newest snapshot."""

from __future__ import annotations

import click

from scenarionet_pipelines.cli.databases import diff_as_json, print_diff
from scenarionet_pipelines.cli.group import verb
from scenarionet_pipelines.cli.output import print_json
from scenarionet_pipelines.cli.parameters import database_argument, json_option, lake_argument


@verb("rebase", "scenarionet db rebase lake busy", "scenarionet db rebase lake busy --keep-members --json")
@lake_argument
@database_argument
@click.option("--keep-members", is_flag=True, help="Do not run the query; keep the members still in the lake.")
@json_option
def command(lake: str, database: str, keep_members: bool, as_json: bool) -> None:
    """Update a database to the newest snapshot, as a new version, and show what changed.

    The query of the database runs again, after the queries of its parents. Earlier versions are kept.
    """
    from scenarionet_data import Lake

    moved = Lake(lake).rebase(database, keep_members=keep_members)
    if as_json:
        print_json({"moved": [diff_as_json(diff) for diff in moved]})
        return
    if not moved:
        click.echo(f"{database} is already on the newest snapshot")
    for diff in moved:
        print_diff(diff)
