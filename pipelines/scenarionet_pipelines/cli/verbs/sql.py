"""``scenarionet sql``: query a lake."""

from __future__ import annotations

import json
import re
from typing import TYPE_CHECKING, Any

import click

from scenarionet_pipelines.cli.group import verb
from scenarionet_pipelines.cli.output import count, print_json, print_table
from scenarionet_pipelines.cli.parameters import json_option, lake_argument, pairs, parameter_option, snapshot_option
from scenarionet_pipelines.cli.table_file import check_suffix, flat, write_table

if TYPE_CHECKING:
    import polars as pl

_NAME = re.compile(r"[A-Za-z_][A-Za-z0-9_]*")
_MAX_ROWS, _MAX_CELL = 100, 60


@verb(
    "sql",
    'scenarionet sql lake "SELECT dataset, avg(ego_distance) FROM metadata GROUP BY ALL"',
    'scenarionet sql lake "SELECT * FROM objects WHERE max_speed > $fast" -p fast=20 --csv',
    "scenarionet sql lake summary -o summary.parquet",
    "scenarionet sql lake",
)
@lake_argument
@click.argument("query", required=False)
@parameter_option
@click.option(
    "-o", "--output", type=click.Path(dir_okay=False), metavar="FILE", help="Write to a .parquet, .csv or .json file."
)
@click.option("--csv", "as_csv", is_flag=True, help="Print as CSV.")
@snapshot_option
@json_option
def command(
    lake: str,
    query: str | None,
    parameters: tuple[str, ...],
    output: str | None,
    as_csv: bool,
    snapshot: int | None,
    as_json: bool,
) -> None:
    """Query a lake with a SELECT statement or a named query.

    QUERY is one SELECT over the views metadata (one row per scenario; see `scenarionet info filters --columns`),
    tracks, objects, states, lights, maps, shards, quarantine and defects, or over derived views such as ego_states and
    lane_graph (see docs/guides/events.md). $NAME in the statement is replaced by the parameter NAME. Without QUERY,
    the named queries are listed.
    """
    from scenarionet_data import Lake
    from scenarionet_data.query.named_sql import ANALYTICS

    if not query:
        _list_names(as_json)
        return
    if output:
        check_suffix(output, "-o")
    words = pairs(parameters, "--parameter")
    opened = Lake(lake, snapshot)
    if _NAME.fullmatch(query):
        rows = opened.named_query(query, ANALYTICS.load(query).parse(words))
    else:
        rows = opened.sql(query, _values(words))
    if output:
        write_table(rows, output)
        click.echo(f"{count(len(rows), 'row')} in {output}", err=True)
    elif as_json:
        print_json({"columns": rows.columns, "rows": rows.to_dicts()})
    elif as_csv:
        click.echo(flat(rows).write_csv(), nl=False)
    else:
        _print(rows)


def _values(words: dict[str, str]) -> dict[str, Any]:
    """Parse numbers and booleans; everything else is text."""
    return {name: _value(word) for name, word in words.items()}


def _value(word: str) -> Any:
    try:
        return json.loads(word)
    except json.JSONDecodeError:
        return word


def _print(rows: pl.DataFrame) -> None:
    print_table(rows.head(_MAX_ROWS).iter_rows(), rows.columns, _MAX_CELL)
    if len(rows) > _MAX_ROWS:
        click.echo(f"... {len(rows) - _MAX_ROWS:,} more rows; use --csv, --json or -o FILE for all rows", err=True)


def _list_names(as_json: bool) -> None:
    from scenarionet_data.query.named_sql import ANALYTICS

    found = [ANALYTICS.load(name) for name in ANALYTICS.names()]
    if as_json:
        print_json({"queries": [{"name": q.name, "doc": q.doc, "parameters": q.defaults} for q in found]})
        return
    print_table([(q.name, ", ".join(f"{k}={v}" for k, v in q.defaults.items()), q.doc) for q in found])
    click.echo("Run one: scenarionet sql LAKE NAME -p PARAMETER=VALUE")
