"""``scenarionet intersect``: who is in all of several databases."""

from __future__ import annotations

from scenarionet_pipelines.cli.databases import print_made
from scenarionet_pipelines.cli.group import verb
from scenarionet_pipelines.cli.parameters import combination_options


@verb(
    "intersect",
    "scenarionet intersect lake busy far --to both",
    "scenarionet intersect lake busy@1 busy --to still_busy",
)
@combination_options
def command(lake: str, databases: tuple[str, ...], name: str, replace: bool, allow_empty: bool, as_json: bool) -> None:
    """Save the scenarios that are in every one of the databases, in the order of the first."""
    from scenarionet_data import Lake

    opened = Lake(lake)
    made = opened.intersect(*databases, name=name, replace=replace, allow_empty=allow_empty)
    print_made(made, as_json, len(opened.database(databases[0])))
