"""``scenarionet sql``: any question, in SQL or by name."""

from __future__ import annotations

import json
import re
from typing import TYPE_CHECKING, Any

import click

from scenarionet_pipelines.cli.group import verb
from scenarionet_pipelines.cli.output import count, print_json, print_table
from scenarionet_pipelines.cli.parameters import json_option, lake_argument, pairs, snapshot_option
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
@click.option("-p", "parameters", multiple=True, metavar="NAME=VALUE", help="Value for $NAME; repeatable.")
@click.option("-o", "output", type=click.Path(dir_okay=False), help="Write to a .parquet, .csv or .json file.")
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
    """Ask a lake one SELECT, or a question by name.

    The views are metadata (a row a scenario; `scenarionet filters --columns` explains it), tracks, objects,
    states, lights, maps, shards and quarantine; docs/guides/events.md has ego_states, lane_graph and more. Without a
    query, the questions with a name are listed.
    """
    from scenarionet_data import Lake
    from scenarionet_data.query.named_sql import ANALYTICS

    if not query:
        _list_names(as_json)
        return
    if output:
        check_suffix(output, "-o")
    words = pairs(parameters, "-p")
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
    """Numbers and truth values as such, everything else as text."""
    return {name: _value(word) for name, word in words.items()}


def _value(word: str) -> Any:
    try:
        return json.loads(word)
    except json.JSONDecodeError:
        return word


def _print(rows: pl.DataFrame) -> None:
    print_table(rows.head(_MAX_ROWS).iter_rows(), rows.columns, _MAX_CELL)
    if len(rows) > _MAX_ROWS:
        click.echo(f"... {len(rows) - _MAX_ROWS:,} more rows; --csv, --json or -o FILE give all", err=True)


def _list_names(as_json: bool) -> None:
    from scenarionet_data.query.named_sql import ANALYTICS

    found = [ANALYTICS.load(name) for name in ANALYTICS.names()]
    if as_json:
        print_json({"queries": [{"name": q.name, "doc": q.doc, "parameters": q.defaults} for q in found]})
        return
    print_table([(q.name, ", ".join(f"{k}={v}" for k, v in q.defaults.items()), q.doc) for q in found])
    click.echo("Ask one: scenarionet sql LAKE NAME -p PARAMETER=VALUE")
