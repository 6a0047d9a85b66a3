"""``scenarionet tables publish``: a snapshot as tables of an Iceberg or DuckLake catalog."""

from __future__ import annotations

from dataclasses import asdict

import click

from scenarionet_pipelines.cli.group import verb
from scenarionet_pipelines.cli.output import count, print_json, print_table
from scenarionet_pipelines.cli.parameters import json_option, lake_argument


@verb(
    "publish",
    "scenarionet tables publish lake --iceberg catalog",
    "scenarionet tables publish lake --ducklake catalog",
)
@lake_argument
@click.option("--iceberg", metavar="FOLDER", help="Write Iceberg tables and an SQLite catalog.")
@click.option("--ducklake", metavar="FOLDER", help="Write a DuckLake; needs DuckDB's extension ducklake.")
@json_option
def command(lake: str, iceberg: str | None, ducklake: str | None, as_json: bool) -> None:
    """Publish the newest snapshot as the tables metadata, tracks, lights and maps of another catalog.

    The catalog refers to the lake's own Parquet files, so it takes little space and does not change when it grows.
    Only the metadata are written again: content hashes as signed integers, and with the lake's user columns.

    The files must stay where they are. `vacuum` keeps those of snapshots that a saved database was made on.
    """
    from scenarionet_data import Lake

    if (iceberg is None) == (ducklake is None):
        raise click.UsageError("give one of --iceberg FOLDER and --ducklake FOLDER")
    done = Lake(lake).publish(iceberg, "iceberg") if iceberg else Lake(lake).publish(ducklake or "", "ducklake")
    if as_json:
        print_json(asdict(done))
        return
    print_table((name, count(rows, "row"), done.locations[name]) for name, rows in done.num_rows.items())
    click.echo(f"{done.path}: snapshot {done.snapshot} as {done.catalog}")
    if not done.is_kept:
        click.echo(
            f"note: vacuum may delete files of snapshot {done.snapshot} once it is old; a database keeps it: "
            f"scenarionet filter {lake} --name published"
        )
