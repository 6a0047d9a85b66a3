"""``scenarionet diff``: what is different in another database, version or snapshot."""

from __future__ import annotations

import click

from scenarionet_pipelines.cli.databases import diff_as_json, print_diff
from scenarionet_pipelines.cli.group import verb
from scenarionet_pipelines.cli.output import print_json
from scenarionet_pipelines.cli.parameters import json_option, lake_argument


@verb("diff", "scenarionet diff lake busy@1 busy", "scenarionet diff lake @3 @7 --json")
@lake_argument
@click.argument("before", metavar="BEFORE")
@click.argument("after", metavar="AFTER")
@json_option
def command(lake: str, before: str, after: str, as_json: bool) -> None:
    """Say which scenarios came, went or changed, and which columns of metadata changed for how many.

    BEFORE and AFTER are databases (DB or DB@VERSION), or @SNAPSHOT for the whole lake at that snapshot.
    """
    from scenarionet_data import Lake

    diff = Lake(lake).diff(before, after)
    if as_json:
        print_json(diff_as_json(diff))
    else:
        print_diff(diff)
