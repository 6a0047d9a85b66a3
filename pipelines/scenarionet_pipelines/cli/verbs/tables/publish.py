"""``scenarionet tables publish``: a snapshot as tables of an Iceberg or DuckLake catalog."""

from __future__ import annotations

from dataclasses import asdict

import click

from scenarionet_pipelines.cli.output import count, table
from scenarionet_pipelines.cli.verb import LakeVerb, option


class PublishVerb(LakeVerb):
    """Publish the newest snapshot as the tables metadata, tracks, lights and maps of another catalog.

    The catalog refers to the lake's own Parquet files, so it takes little space and does not change when it grows.
    Only the metadata are written again: content hashes as signed integers, and with the lake's user columns.

    The files must stay where they are. `vacuum` keeps those of snapshots that a saved database was made on.
    """

    examples = (
        "scenarionet tables publish lake --iceberg catalog",
        "scenarionet tables publish lake --ducklake catalog",
    )
    iceberg: str | None = option("Write Iceberg tables and an SQLite catalog.", metavar="FOLDER")
    ducklake: str | None = option("Write a DuckLake; needs DuckDB's extension ducklake.", metavar="FOLDER")

    def run(self) -> None:
        if (self.iceberg is None) == (self.ducklake is None):
            raise click.UsageError("give one of --iceberg FOLDER and --ducklake FOLDER")
        lake = self.open()
        done = lake.publish(self.ducklake, "ducklake") if self.ducklake else lake.publish(self.iceberg or "", "iceberg")
        lines = table((name, count(rows, "row"), done.locations[name]) for name, rows in done.num_rows.items())
        lines.append(f"{done.path}: snapshot {done.snapshot} as {done.catalog}")
        if not done.is_kept:
            old = f"vacuum may delete files of snapshot {done.snapshot} once it is old"
            lines.append(f"note: {old}; a database keeps it: scenarionet filter {self.lake} --name published")
        self.say(asdict(done), lines)
