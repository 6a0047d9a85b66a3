"""``scenarionet filter``: the scenarios that satisfy conditions, saved under a name."""

from __future__ import annotations

from dataclasses import asdict

import click

from pipelines.cli.group import verb
from pipelines.cli.output import count, print_json
from pipelines.cli.parameters import json_option, lake_argument, new_version_option


@verb(
    "filter",
    'scenarionet filter lake --where "ego_distance > 10 AND num_objects > 200" --to busy',
    "scenarionet filter lake --filter no_overpass --filter ego_distance:min=25 --to far",
    "scenarionet filter lake --from busy --where has_intersection --to crossings --overwrite",
)
@lake_argument
@click.option("--where", default="true", metavar="EXPR", help="Condition in SQL over the columns of metadata.")
@click.option("--filter", "named", multiple=True, metavar="NAME:KEY=VALUE,...", help="Named filter; repeatable.")
@click.option("--from", "parent", metavar="DB", help="Search this database only, in its order.")
@click.option("--to", "name", required=True, metavar="NAME", help="Name of the new database.")
@new_version_option
@json_option
def command(
    lake: str,
    where: str,
    named: tuple[str, ...],
    parent: str | None,
    name: str,
    overwrite: bool,
    as_json: bool,
) -> None:
    """Save the scenarios that satisfy conditions as a database.

    A database copies nothing: it is a list of scenarios that remembers how it was made. `scenarionet filters`
    lists the named filters; with --columns, what --where may ask for.
    """
    from scenarionet_data import Lake

    opened = Lake(lake)
    made = opened.filter(where, name=name, parent=parent, named=named, overwrite=overwrite)
    total = len(opened.database(parent)) if parent else len(opened)
    if as_json:
        print_json({"name": made.name, "reference": made.reference, "of": total} | asdict(made.lineage))
    else:
        click.echo(f"{made.reference}: {len(made):,} of {count(total, 'scenario')}")
