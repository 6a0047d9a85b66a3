"""``scenarionet subtract``: who is in one database and in no other."""

from __future__ import annotations

from scenarionet_pipelines.cli.databases import print_made
from scenarionet_pipelines.cli.group import verb
from scenarionet_pipelines.cli.parameters import combination_options


@verb("subtract", "scenarionet subtract lake busy seen --to unseen", "scenarionet subtract lake a b c --to rest")
@combination_options
def command(lake: str, databases: tuple[str, ...], name: str, replace: bool, allow_empty: bool, as_json: bool) -> None:
    """Save the scenarios of the first database that are in none of the others, in its order."""
    from scenarionet_data import Lake

    opened = Lake(lake)
    made = opened.subtract(*databases, name=name, replace=replace, allow_empty=allow_empty)
    print_made(made, as_json, len(opened.database(databases[0])))
