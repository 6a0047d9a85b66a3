"""``scenarionet db diff``: compare two databases, or two snapshots of the lake."""

from __future__ import annotations

import click

from scenarionet_pipelines.cli.databases import diff_as_json, print_diff
from scenarionet_pipelines.cli.group import verb
from scenarionet_pipelines.cli.output import print_json
from scenarionet_pipelines.cli.parameters import json_option, lake_argument


@verb("diff", "scenarionet db diff lake busy@1 busy", "scenarionet db diff lake @3 @7 --json")
@lake_argument
@click.argument("old", metavar="OLD")
@click.argument("new", metavar="NEW")
@json_option
def command(lake: str, old: str, new: str, as_json: bool) -> None:
    """Show which scenarios were added, removed or changed, and which columns changed.

    OLD and NEW are databases (DATABASE or DATABASE@VERSION), or @SNAPSHOT for the whole lake at that snapshot.
    """
    from scenarionet_data import Lake

    diff = Lake(lake).diff(old, new)
    if as_json:
        print_json(diff_as_json(diff))
    else:
        print_diff(diff)
