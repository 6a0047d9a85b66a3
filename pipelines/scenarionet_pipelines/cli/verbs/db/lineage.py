"""``scenarionet db lineage``: show how a database was made."""

from __future__ import annotations

from dataclasses import asdict
from textwrap import indent
from typing import TYPE_CHECKING

import click

from scenarionet_pipelines.cli.output import count, print_json
from scenarionet_pipelines.cli.verb import DatabaseVerb, option

if TYPE_CHECKING:
    from scenarionet_data.operations.lineage import LineageTree


class LineageVerb(DatabaseVerb):
    """Show how a database was made, with the databases it was made from, as a tree."""

    examples = (
        "scenarionet db lineage lake busy_train",
        "scenarionet db lineage lake busy@1 --sql",
        "scenarionet db lineage lake busy --json",
    )
    with_sql: bool = option("Also print the SQL and its parameters.", "--sql")

    def run(self) -> None:
        from scenarionet_data import Lake

        found = Lake(self.lake).lineage(self.database)
        if self.as_json:
            print_json(asdict(found))
        else:
            print_tree(found, self.with_sql)


def print_tree(found: LineageTree, with_sql: bool, margin: str = "") -> None:
    """Print how a database was made, then its parents, further to the right."""
    made, inner = "no longer in the lake", margin + "    "
    lineage = found.lineage
    if lineage is not None:
        seed = f", seed {lineage.parameters['seed']}" if "seed" in lineage.parameters else ""
        where = f"snapshot {lineage.snapshot}, {lineage.created_at}, {lineage.created_with}"
        made = f"{count(lineage.count, 'scenario')} by {lineage.operation}{seed}, {where}"
        made += "" if found.is_here else "; its members are not in this lake"
    click.echo(f"{margin}{found.reference}: {made}")
    if lineage is not None and with_sql:
        click.echo(indent(lineage.sql, inner + "| "))
        for name, value in lineage.parameters.items():
            click.echo(f"{inner}${name} = {value!r}")
    if len(found.versions) > 1:
        click.echo(f"{inner}versions {', '.join(map(str, found.versions))}")
    if found.children:
        click.echo(f"{inner}used by {', '.join(found.children)}")
    for parent in found.parents:
        print_tree(parent, with_sql, inner)
