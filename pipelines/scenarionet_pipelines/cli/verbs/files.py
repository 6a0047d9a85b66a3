"""``scenarionet files``: which Parquet files make up a table, for any other engine."""

from __future__ import annotations

import click

from scenarionet_pipelines.cli.group import verb
from scenarionet_pipelines.cli.output import print_json
from scenarionet_pipelines.cli.parameters import json_option, lake_argument, snapshot_option


@verb("files", "scenarionet files lake metadata", "scenarionet files lake tracks --json")
@lake_argument
@click.argument("table")
@snapshot_option
@json_option
def command(lake: str, table: str, snapshot: int | None, as_json: bool) -> None:
    """List the files of a table: what Spark, Polars or pandas has to read.

    TABLE is metadata, tracks, lights, maps, shards or quarantine. Read these files and not the folder: it may
    hold files of jobs that are not finished, and of older snapshots.
    """
    from scenarionet_data import Lake

    paths = Lake(lake, snapshot).paths(table)
    if as_json:
        print_json({"table": table, "files": paths})
    else:
        click.echo("\n".join(paths), nl=bool(paths))
