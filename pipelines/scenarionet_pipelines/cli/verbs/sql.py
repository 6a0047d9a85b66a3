"""``scenarionet sql``: query a lake."""

from __future__ import annotations

import json
import re
from typing import TYPE_CHECKING, Any

import click

from scenarionet_data.errors import QueryError
from scenarionet_pipelines.cli.named import show_named
from scenarionet_pipelines.cli.output import print_json, print_table
from scenarionet_pipelines.cli.parameters import pairs
from scenarionet_pipelines.cli.table_file import check_suffix, flat, write_table
from scenarionet_pipelines.cli.verb import PARAMETERS, SNAPSHOT, LakeVerb, argument, option

if TYPE_CHECKING:
    import pyarrow as pa

_NAME = re.compile(r"[A-Za-z_][A-Za-z0-9_]*")
_MAX_ROWS, _MAX_CELL = 100, 60


class SqlVerb(LakeVerb):
    """Query a lake with a SELECT statement or a named query.

    QUERY is one SELECT over the views metadata (one row per scenario; see `scenarionet info filters --columns`),
    tracks, objects, states, lights, maps, shards, quarantine and defects, or over derived views such as ego_states and
    lane_graph (see docs/guides/events.md). $NAME in the statement is replaced by the parameter NAME. Without QUERY,
    the named queries are listed.
    """

    examples = (
        'scenarionet sql lake "SELECT dataset, avg(ego_distance) FROM metadata GROUP BY ALL"',
        'scenarionet sql lake "SELECT * FROM objects WHERE max_speed > $fast" -p fast=20 --csv',
        "scenarionet sql lake summary -o summary.parquet",
        "scenarionet sql lake",
    )
    query: str | None = argument()
    parameters: tuple[str, ...] = PARAMETERS
    output: str | None = option("Write to a .parquet, .csv or .json file.", "-o", "--output", metavar="FILE")
    as_csv: bool = option("Print as CSV.", "--csv")
    snapshot: int | None = SNAPSHOT

    def run(self) -> None:
        from scenarionet_data.query.named_sql import ANALYTICS

        if not self.query:
            show_named(ANALYTICS, "queries", self.as_json)
            return
        if self.output:
            check_suffix(self.output, "-o")
        words = pairs(self.parameters, "-p")
        opened = self.open_view()
        query, values = self.query, {name: parse_value(word) for name, word in words.items()}
        if _NAME.fullmatch(query):
            named = ANALYTICS.load(query)
            query, values = named.text, named.bind(named.parse(words))
        if self.output:
            write_table(opened.sql(query, values), self.output)
        elif self.as_csv:
            click.echo(flat(opened.sql(query, values)).write_csv(), nl=False)
        else:
            self.show(opened.arrow(query, values))  # not as Polars, which takes 0.1 s to import

    def show(self, found: pa.Table) -> None:
        """Print rows as a table or JSON."""
        names = found.column_names
        try:
            rows = found.to_pylist() if self.as_json else found.slice(0, _MAX_ROWS).to_pylist()
        except ValueError as error:  # Python has no nanoseconds
            raise QueryError(f"{error}; cast it to VARCHAR") from error
        if self.as_json:
            print_json({"columns": names, "rows": rows})
            return
        print_table((row.values() for row in rows), names, _MAX_CELL)
        if len(found) > _MAX_ROWS:
            more = f"{len(found) - _MAX_ROWS:,} more rows; use --csv, --json or -o FILE for all rows"
            click.echo(f"... {more}", err=True)


def parse_value(word: str) -> Any:
    """Parse a number or a boolean; everything else is text."""
    try:
        return json.loads(word)
    except json.JSONDecodeError:
        return word
