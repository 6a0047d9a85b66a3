"""``scenarionet mine``: where an event happens."""

from __future__ import annotations

from typing import TYPE_CHECKING

import click

from scenarionet_pipelines.cli.group import verb
from scenarionet_pipelines.cli.output import count, print_json, print_table
from scenarionet_pipelines.cli.parameters import json_option, lake_argument, pairs, snapshot_option

if TYPE_CHECKING:
    import polars as pl

    from scenarionet_data.query.named_sql import NamedSql


@verb(
    "mine",
    "scenarionet mine lake cut_in",
    "scenarionet mine lake time_to_collision --set max=2.5 --from busy --limit 20",
    "scenarionet mine lake hard_braking --set ego_only=true --json",
    "scenarionet mine lake",
)
@lake_argument
@click.argument("event", required=False)
@click.option("--set", "settings", multiple=True, metavar="KEY=VALUE", help="Value of a parameter; repeatable.")
@click.option("--from", "database", metavar="DB", help="Look at the members of this database only.")
@click.option("--limit", type=click.IntRange(0), help="Show so many hits; a table shows 50 unless told.")
@snapshot_option
@json_option
def command(
    lake: str,
    event: str | None,
    settings: tuple[str, ...],
    database: str | None,
    limit: int | None,
    snapshot: int | None,
    as_json: bool,
) -> None:
    """List where an event happens: scenario, who, with whom, from when to when.

    Events are files in sql/events, each with its definition, source and parameters; without an EVENT they are listed.
    `scenarionet filter --event cut_in` keeps the scenarios in which it happens, `scenarionet tag --event cut_in` counts
    it once and for all.
    """
    from scenarionet_data import Lake
    from scenarionet_data.query.named_sql import EVENTS

    if event is None:
        _list_events([EVENTS.load(name) for name in EVENTS.names()], as_json)
        return
    found = Lake(lake, snapshot).mine(event, EVENTS.load(event).parse(pairs(settings, "--set")), database)
    if as_json:
        shown = found if limit is None else found.head(limit)
        scenarios = found["scenario_id"].n_unique()
        print_json({"event": event, "hits": len(found), "scenarios": scenarios, "rows": shown.to_dicts()})
    else:
        _print(found, 50 if limit is None else limit)


def _print(found: pl.DataFrame, limit: int) -> None:
    print_table(found.head(limit).iter_rows(), found.columns if len(found) and limit else ())
    hits, scenarios = count(len(found), "hit"), count(found["scenario_id"].n_unique(), "scenario")
    click.echo(f"{hits} in {scenarios}", err=True)


def _list_events(found: list[NamedSql], as_json: bool) -> None:
    if as_json:
        print_json({"events": [{"name": e.name, "doc": e.doc, "parameters": e.defaults} for e in found]})
        return
    for event in found:
        parameters = ",".join(f"{key}={str(value).lower()}" for key, value in event.defaults.items())
        click.echo(f"{event.name}:{parameters}")
        click.echo(click.wrap_text(event.doc, 110, "    ", "    "))
