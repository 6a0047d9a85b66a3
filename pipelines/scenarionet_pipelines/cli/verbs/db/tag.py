"""``scenarionet db tag``: add, list and remove user columns."""

from __future__ import annotations

from dataclasses import asdict
from typing import TYPE_CHECKING

import click

from scenarionet_data.errors import BadParameter
from scenarionet_pipelines.cli.group import verb
from scenarionet_pipelines.cli.output import count, print_json, print_table
from scenarionet_pipelines.cli.parameters import json_option, lake_argument

if TYPE_CHECKING:
    from scenarionet_data import Lake
    from scenarionet_data.databases.user_columns import UserColumn


@verb(
    "tag",
    'scenarionet db tag lake fast --where "ego_max_speed > 20"',
    "scenarionet db tag lake cut_ins --event cut_in:max_gap=20",
    'scenarionet db tag lake red_seconds --sql "SELECT scenario_id, 0.1 * count(*) FROM at_red GROUP BY scenario_id"',
    "scenarionet db tag lake score --file scores.csv --column score",
    "scenarionet db tag lake",
    "scenarionet db tag lake --drop score",
    "scenarionet db tag lake --drop score@1 --force",
)
@lake_argument
@click.argument("name", required=False)
@click.option("--where", metavar="EXPR", help="Label: whether this SQL condition over the columns of metadata holds.")
@click.option("--event", metavar="NAME[:KEY=VALUE,...]", help="Count: number of occurrences of this event.")
@click.option("--sql", "query", metavar="SELECT", help="Query that selects scenario_id and one other column.")
@click.option(
    "--file",
    type=click.Path(dir_okay=False),
    metavar="FILE",
    help="A .csv or .parquet file with scenario_id and another column.",
)
@click.option("--column", metavar="NAME", help="With --file: the column to use if there are several.")
@click.option("--replace", is_flag=True, help="Save a new version if the column exists.")
@click.option("--drop", metavar="NAME", help="Remove a user column, or one version of it (NAME@VERSION).")
@click.option("--force", is_flag=True, help="With --drop: even if databases use the column; those cannot be rebuilt.")
@json_option
def command(
    lake: str,
    name: str | None,
    where: str | None,
    event: str | None,
    query: str | None,
    file: str | None,
    column: str | None,
    replace: bool,
    drop: str | None,
    force: bool,
    as_json: bool,
) -> None:
    """Add a user column to the lake, such as a label, a count, a score or an embedding.

    A user column is a side table keyed by scenario id; no scenario is rewritten. Conditions, SQL and filters use it
    like any other column of metadata, with null for scenarios without a value. Without NAME, the user columns are
    listed. --drop removes one; --force is required if databases depend on it.
    """
    from scenarionet_data import Lake

    opened = Lake(lake)
    given = {"--where": where, "--event": event, "--sql": query, "--file": file}
    chosen = [(option, value) for option, value in given.items() if value is not None]
    if (drop and (name or chosen or column or replace)) or (force and not drop):
        raise BadParameter("--drop NAME takes no other option than --force")
    if drop:
        _drop(opened, drop, force, as_json)
        return
    if name is None and not chosen:
        _list(opened, as_json)
        return
    if name is None:
        raise BadParameter("the column needs a NAME: scenarionet db tag LAKE NAME ...")
    if len(chosen) != 1 or (column and not file):
        raise BadParameter(f"expected one of {', '.join(given)}; --column requires --file")
    tagged = _tag(opened, name, *chosen[0], column, replace)
    if as_json:
        print_json(asdict(tagged) | {"reference": tagged.reference})
    else:
        click.echo(f"{tagged.reference}: {tagged.type} for {tagged.count:,} of {count(len(opened), 'scenario')}")


def _tag(lake: Lake, name: str, option: str, value: str, column: str | None, replace: bool) -> UserColumn:
    if option == "--where":
        return lake.tag_where(name, value, replace=replace)
    if option == "--event":
        return lake.tag_event(name, value, replace=replace)
    if option == "--sql":
        return lake.tag_by_sql(name, value, replace=replace)
    return lake.tag_from_file(name, value, column, replace=replace)


def _drop(lake: Lake, reference: str, force: bool, as_json: bool) -> None:
    lake.untag(reference, force=force)
    if as_json:
        print_json({"dropped": reference})
    else:
        click.echo(f"dropped {reference}")


def _list(lake: Lake, as_json: bool) -> None:
    from scenarionet_data.databases import user_columns

    found = [user_columns.read(lake.files, name, version) for name, version in lake.user_columns.items()]
    if as_json:
        print_json({"user_columns": [asdict(each) | {"reference": each.reference} for each in found]})
    elif found:
        rows = [(each.reference, each.type, each.count, each.source, each.created_at) for each in found]
        print_table(rows, ("column", "type", "scenarios", "from", "at"), max_cell=60)
    else:
        click.echo("no user columns; add one: scenarionet db tag LAKE NAME --where ...")
