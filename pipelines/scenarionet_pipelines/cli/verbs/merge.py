"""``scenarionet merge``: save the union of several databases."""

from __future__ import annotations

from dataclasses import asdict

import click

from scenarionet_pipelines.cli.databases import print_created
from scenarionet_pipelines.cli.group import verb
from scenarionet_pipelines.cli.output import count, print_json
from scenarionet_pipelines.cli.parameters import combination_options


@verb(
    "merge", "scenarionet merge lake busy far --name both", "scenarionet merge lake a b c --name all --replace --json"
)
@combination_options
def command(lake: str, databases: tuple[str, ...], name: str, replace: bool, allow_empty: bool, as_json: bool) -> None:
    """Save the union of several databases, one after the other, each scenario once.

    A scenario that is in several databases keeps the position and weight it has in the first. The number of repeated
    scenarios is printed; `scenarionet db overlap` shows which databases share them.
    """
    from scenarionet_data import Lake

    opened = Lake(lake)
    created = opened.merge(*databases, name=name, replace=replace, allow_empty=allow_empty)
    repeated = sum(len(opened.database(parent)) for parent in created.lineage.parents) - len(created)
    if as_json:
        print_json(
            {"name": created.name, "reference": created.reference, "repeated": repeated} | asdict(created.lineage)
        )
        return
    print_created(created, as_json)
    if repeated:
        click.echo(f"left out: {count(repeated, 'repeated scenario')}")
