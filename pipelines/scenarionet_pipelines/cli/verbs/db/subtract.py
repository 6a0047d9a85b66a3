"""``scenarionet db subtract``: save the scenarios of one database that others do not contain."""

from __future__ import annotations

from scenarionet_pipelines.cli.databases import print_created
from scenarionet_pipelines.cli.group import verb
from scenarionet_pipelines.cli.parameters import combination_options


@verb(
    "subtract", "scenarionet db subtract lake busy seen --name unseen", "scenarionet db subtract lake a b c --name rest"
)
@combination_options
def command(lake: str, databases: tuple[str, ...], name: str, replace: bool, allow_empty: bool, as_json: bool) -> None:
    """Save the scenarios of the first database that are in none of the others, in its order."""
    from scenarionet_data import Lake

    print_created(Lake(lake).subtract(*databases, name=name, replace=replace, allow_empty=allow_empty), as_json)
