"""``scenarionet filter``: the scenarios that satisfy conditions, saved under a name."""

from __future__ import annotations

from pathlib import Path

import click

from scenarionet_pipelines.cli.databases import print_made
from scenarionet_pipelines.cli.group import verb
from scenarionet_pipelines.cli.parameters import (
    allow_empty_option,
    json_option,
    lake_argument,
    new_version_option,
    to_option,
)


@verb(
    "filter",
    'scenarionet filter lake --where "ego_distance > 10 AND num_objects > 200" --to busy',
    "scenarionet filter lake --filter no_overpass --filter object_type:type=cyclist,min=3 --to cyclists",
    "scenarionet filter lake --from busy --where has_intersection --to crossings --replace",
    "scenarionet filter lake --where has_intersection --event cut_in:max_gap=20 --to cut_ins",
    "scenarionet filter lake --ids chosen.txt --to chosen",
)
@lake_argument
@click.option("--where", default="true", metavar="EXPR", help="Condition in SQL over the columns of metadata.")
@click.option("--filter", "named", multiple=True, metavar="NAME:KEY=VALUE,...", help="Named filter; repeatable.")
@click.option(
    "--event", "happening", multiple=True, metavar="NAME:KEY=VALUE,...", help="An event happens in it; repeatable."
)
@click.option("--id", "ids", multiple=True, metavar="ID", help="Only this scenario, by its whole id; repeatable.")
@click.option("--ids", "file", type=click.Path(), help="Only scenarios in this file, an id a line.")
@click.option("--from", "parent", metavar="DB", help="Search this database only, in its order.")
@to_option
@new_version_option
@allow_empty_option
@json_option
def command(
    lake: str,
    where: str,
    named: tuple[str, ...],
    happening: tuple[str, ...],
    ids: tuple[str, ...],
    file: str | None,
    parent: str | None,
    name: str,
    replace: bool,
    allow_empty: bool,
    as_json: bool,
) -> None:
    """Save the scenarios that satisfy conditions as a database.

    A database copies nothing: it is a list of scenarios that remembers how it was made. `scenarionet filters`
    lists the named filters; with --columns, what --where may ask for; `scenarionet mine LAKE` lists the
    events. All conditions have to hold. An id may also
    be the whole id in the source; one that nobody has is an error.
    """
    from scenarionet_data import Lake

    opened = Lake(lake)
    listed = [*ids, *(Path(file).read_text("utf-8").split() if file else ())]
    made = opened.filter(
        where,
        name=name,
        database=parent,
        filters=named,
        events=happening,
        ids=listed if ids or file else None,
        replace=replace,
        allow_empty=allow_empty,
    )
    print_made(made, as_json, len(opened.database(parent)) if parent else len(opened))
