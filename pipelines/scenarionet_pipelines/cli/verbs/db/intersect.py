"""``scenarionet db intersect``: save the scenarios that several databases have in common."""

from __future__ import annotations

from scenarionet_pipelines.cli.databases import print_created
from scenarionet_pipelines.cli.group import verb
from scenarionet_pipelines.cli.parameters import combination_options


@verb(
    "intersect",
    "scenarionet db intersect lake busy far --name both",
    "scenarionet db intersect lake busy@1 busy --name still_busy",
)
@combination_options
def command(lake: str, databases: tuple[str, ...], name: str, replace: bool, allow_empty: bool, as_json: bool) -> None:
    """Save the scenarios that are in every one of the databases, in the order of the first."""
    from scenarionet_data import Lake

    print_created(Lake(lake).intersect(*databases, name=name, replace=replace, allow_empty=allow_empty), as_json)
