"""``scenarionet db rename``: rename a database."""

from __future__ import annotations

import click

from scenarionet_pipelines.cli.output import print_json
from scenarionet_pipelines.cli.verb import DatabaseVerb, argument


class RenameVerb(DatabaseVerb):
    """Rename a database with all its versions.

    Refused if other databases were made from it, because their lineage refers to its name.
    """

    examples = (
        "scenarionet db rename lake busy crowded",
        "scenarionet db rename lake tmp train --json",
    )
    name: str = argument("NAME")

    def run(self) -> None:
        from scenarionet_data import Lake

        Lake(self.lake).rename(self.database, name=self.name)
        if self.as_json:
            print_json({"before": self.database, "name": self.name})
        else:
            click.echo(f"{self.database} -> {self.name}")
