"""``scenarionet db drop``: remove a database."""

from __future__ import annotations

import click

from scenarionet_pipelines.cli.output import print_json
from scenarionet_pipelines.cli.verb import DatabaseVerb, option


class DropVerb(DatabaseVerb):
    """Remove a database, or one version of it (DATABASE@VERSION). The scenarios stay in the lake."""

    examples = (
        "scenarionet db drop lake busy",
        "scenarionet db drop lake busy@1 --force",
    )
    force: bool = option("Drop it even if other databases were made from it; those cannot be rebuilt.")

    def run(self) -> None:
        from scenarionet_data import Lake

        Lake(self.lake).drop(self.database, force=self.force)
        if self.as_json:
            print_json({"dropped": self.database})
        else:
            click.echo(f"dropped {self.database}")
