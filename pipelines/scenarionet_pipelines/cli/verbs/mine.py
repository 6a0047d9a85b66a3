"""``scenarionet mine``: find events in scenarios."""

from __future__ import annotations

from typing import TYPE_CHECKING

import click

from scenarionet_pipelines.cli.group import verb
from scenarionet_pipelines.cli.output import count, print_json, print_table
from scenarionet_pipelines.cli.parameters import (
    database_option,
    json_option,
    lake_argument,
    pairs,
    parameter_option,
    snapshot_option,
)

if TYPE_CHECKING:
    import polars as pl

    from scenarionet_data.query.named_sql import NamedSql


@verb(
    "mine",
    "scenarionet mine lake cut_in",
    "scenarionet mine lake time_to_collision -p max=2.5 --database busy --limit 20",
    "scenarionet mine lake hard_braking -p ego_only=true --json",
    "scenarionet mine lake",
)
@lake_argument
@click.argument("event", required=False)
@parameter_option
@database_option
@click.option(
    "--limit", type=click.IntRange(0), metavar="N", help="Print at most N occurrences. [default: 50 in a table]"
)
@snapshot_option
@json_option
def command(
    lake: str,
    event: str | None,
    parameters: tuple[str, ...],
    database: str | None,
    limit: int | None,
    snapshot: int | None,
    as_json: bool,
) -> None:
    """List the occurrences of an event: scenario, objects involved, start and end.

    Events are SQL files in sql/events, each with its definition, source and parameters; without EVENT they are
    listed. `scenarionet filter --event cut_in` selects the scenarios with the event, `scenarionet db tag --event
    cut_in` stores its number of occurrences as a user column.
    """
    from scenarionet_data import Lake
    from scenarionet_data.query.named_sql import EVENTS

    if event is None:
        _list_events([EVENTS.load(name) for name in EVENTS.names()], as_json)
        return
    found = Lake(lake, snapshot).mine(event, EVENTS.load(event).parse(pairs(parameters, "--parameter")), database)
    if as_json:
        shown = found if limit is None else found.head(limit)
        scenarios = found["scenario_id"].n_unique()
        print_json({"event": event, "hits": len(found), "scenarios": scenarios, "rows": shown.to_dicts()})
    else:
        _print(found, 50 if limit is None else limit)


def _print(found: pl.DataFrame, limit: int) -> None:
    print_table(found.head(limit).iter_rows(), found.columns if len(found) and limit else ())
    hits, scenarios = count(len(found), "occurrence"), count(found["scenario_id"].n_unique(), "scenario")
    click.echo(f"{hits} in {scenarios}", err=True)


def _list_events(found: list[NamedSql], as_json: bool) -> None:
    if as_json:
        print_json({"events": [{"name": e.name, "doc": e.doc, "parameters": e.defaults} for e in found]})
        return
    for event in found:
        parameters = ",".join(f"{key}={str(value).lower()}" for key, value in event.defaults.items())
        click.echo(f"{event.name}:{parameters}")
        click.echo(click.wrap_text(event.doc, 110, "    ", "    "))
