"""``scenarionet tables files``: list the Parquet files of a table."""

from __future__ import annotations

import click

from scenarionet_pipelines.cli.group import verb
from scenarionet_pipelines.cli.output import print_json
from scenarionet_pipelines.cli.parameters import json_option, lake_argument, snapshot_option


@verb("files", "scenarionet tables files lake metadata", "scenarionet tables files lake tracks --json")
@lake_argument
@click.argument("table")
@snapshot_option
@json_option
def command(lake: str, table: str, snapshot: int | None, as_json: bool) -> None:
    """List the Parquet files of a table, for Spark, Polars, pandas or any other engine.

    TABLE is metadata, tracks, lights, maps, shards, quarantine or defects. Read these files rather than the whole
    folder, which may also contain files of unfinished jobs and of older snapshots.
    """
    from scenarionet_data import Lake

    paths = Lake(lake, snapshot).paths(table)
    if as_json:
        print_json({"table": table, "files": paths})
    else:
        click.echo("\n".join(paths), nl=bool(paths))
