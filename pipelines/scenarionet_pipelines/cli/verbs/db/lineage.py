"""``scenarionet db lineage``: show how a database was made."""

from __future__ import annotations

from dataclasses import asdict
from textwrap import indent
from typing import TYPE_CHECKING

import click

from scenarionet_pipelines.cli.group import verb
from scenarionet_pipelines.cli.output import count, print_json
from scenarionet_pipelines.cli.parameters import database_argument, json_option, lake_argument

if TYPE_CHECKING:
    from scenarionet_data.databases.record import Lineage
    from scenarionet_data.operations.lineage import LineageTree


@verb(
    "lineage",
    "scenarionet db lineage lake busy_train",
    "scenarionet db lineage lake busy@1 --sql",
    "scenarionet db lineage lake busy --json",
)
@lake_argument
@database_argument
@click.option("--sql", "with_sql", is_flag=True, help="Also print the SQL and its parameters.")
@json_option
def command(lake: str, database: str, with_sql: bool, as_json: bool) -> None:
    """Show how a database was made, with the databases it was made from, as a tree."""
    from scenarionet_data import Lake

    found = Lake(lake).lineage(database)
    if as_json:
        print_json(asdict(found))
    else:
        _print(found, with_sql, "")


def _print(found: LineageTree, with_sql: bool, margin: str) -> None:
    away = "; its members are not in this lake" if found.lineage and not found.is_here else ""
    click.echo(f"{margin}{found.reference}: {_made(found.lineage)}{away}")
    inner = margin + "    "
    if found.lineage and with_sql:
        click.echo(indent(found.lineage.sql, inner + "| "))
        for name, value in found.lineage.parameters.items():
            click.echo(f"{inner}${name} = {value!r}")
    if len(found.versions) > 1:
        click.echo(f"{inner}versions {', '.join(map(str, found.versions))}")
    if found.children:
        click.echo(f"{inner}used by {', '.join(found.children)}")
    for parent in found.parents:
        _print(parent, with_sql, inner)


def _made(lineage: Lineage | None) -> str:
    if lineage is None:
        return "no longer in the lake"
    seed = f", seed {lineage.parameters['seed']}" if "seed" in lineage.parameters else ""
    where = f"snapshot {lineage.snapshot}, {lineage.created_at}, {lineage.created_with}"
    return f"{count(lineage.count, 'scenario')} by {lineage.operation}{seed}, {where}"
