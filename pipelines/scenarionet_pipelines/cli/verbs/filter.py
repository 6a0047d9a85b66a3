"""``scenarionet filter``: save the scenarios that satisfy conditions as a database."""

from __future__ import annotations

from pathlib import Path

import click

from scenarionet_pipelines.cli.databases import print_created
from scenarionet_pipelines.cli.group import verb
from scenarionet_pipelines.cli.parameters import (
    allow_empty_option,
    database_option,
    json_option,
    lake_argument,
    name_option,
    new_version_option,
)


@verb(
    "filter",
    'scenarionet filter lake --where "ego_distance > 10 AND num_objects > 200" --name busy',
    "scenarionet filter lake --filter no_overpass --filter object_type:type=cyclist,min=3 --name cyclists",
    "scenarionet filter lake --database busy --where has_intersection --name crossings --replace",
    "scenarionet filter lake --where has_intersection --event cut_in:max_gap=20 --name cut_ins",
    "scenarionet filter lake --ids chosen.txt --name chosen",
)
@lake_argument
@click.option("--where", default="true", metavar="EXPR", help="SQL condition over the columns of metadata.")
@click.option(
    "--filter", "filters", multiple=True, metavar="NAME[:KEY=VALUE,...]", help="Apply a named filter; repeatable."
)
@click.option("--event", "events", multiple=True, metavar="NAME[:KEY=VALUE,...]", help="Require an event; repeatable.")
@click.option("--id", "ids", multiple=True, metavar="ID", help="Select a scenario by its id; repeatable.")
@click.option("--ids", "file", type=click.Path(), help="Select the scenarios listed in a file, one id per line.")
@database_option
@name_option
@new_version_option
@allow_empty_option
@json_option
def command(
    lake: str,
    where: str,
    filters: tuple[str, ...],
    events: tuple[str, ...],
    ids: tuple[str, ...],
    file: str | None,
    database: str | None,
    name: str,
    replace: bool,
    allow_empty: bool,
    as_json: bool,
) -> None:
    """Save the scenarios that satisfy all conditions as a database.

    A database is a list of scenario ids with the query that selected them; no scenario is copied. `scenarionet
    info filters` lists the named filters, `scenarionet info filters --columns` the columns for --where, and
    `scenarionet mine LAKE` the events. An id may also be the scenario's id in its source dataset; unknown ids are an
    error.
    """
    from scenarionet_data import Lake

    listed = [*ids, *(Path(file).read_text("utf-8").split() if file else ())]
    created = Lake(lake).filter(
        where,
        name=name,
        database=database,
        filters=filters,
        events=events,
        ids=listed if ids or file else None,
        replace=replace,
        allow_empty=allow_empty,
    )
    print_created(created, as_json)
