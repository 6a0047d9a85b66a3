"""``scenarionet merge``: several databases as one."""

from __future__ import annotations

from dataclasses import asdict

import click

from scenarionet_pipelines.cli.databases import print_made
from scenarionet_pipelines.cli.group import verb
from scenarionet_pipelines.cli.output import count, print_json
from scenarionet_pipelines.cli.parameters import combination_options


@verb("merge", "scenarionet merge lake busy far --to both", "scenarionet merge lake a b c --to all --replace --json")
@combination_options
def command(lake: str, databases: tuple[str, ...], name: str, replace: bool, allow_empty: bool, as_json: bool) -> None:
    """Save the scenarios of several databases as one: one database after the other, nobody twice.

    Who is in several of them keeps the place and weight of the first. How many that are is reported;
    `scenarionet overlap` says between which.
    """
    from scenarionet_data import Lake

    opened = Lake(lake)
    made = opened.merge(*databases, name=name, replace=replace, allow_empty=allow_empty)
    shared = sum(len(opened.database(parent)) for parent in made.lineage.parents) - len(made)
    if as_json:
        print_json({"name": made.name, "reference": made.reference, "repeated": shared} | asdict(made.lineage))
        return
    print_made(made, as_json)
    if shared:
        click.echo(f"left out: {count(shared, 'scenario')} that came again with a later database")
