"""``scenarionet db rebase``: update a database to the newest snapshot."""

from __future__ import annotations

import click

from scenarionet_pipelines.cli.databases import diff_as_json, print_diff
from scenarionet_pipelines.cli.output import print_json
from scenarionet_pipelines.cli.verb import DatabaseVerb, option


class RebaseVerb(DatabaseVerb):
    """Update a database to the newest snapshot, as a new version, and show what changed.

    The query of the database runs again, after the queries of its parents. Earlier versions are kept.
    """

    examples = (
        "scenarionet db rebase lake busy",
        "scenarionet db rebase lake busy --keep-members --json",
    )
    keep_members: bool = option("Do not run the query; keep the members still in the lake.")

    def run(self) -> None:
        from scenarionet_data import Lake

        moved = Lake(self.lake).rebase(self.database, keep_members=self.keep_members)
        if self.as_json:
            print_json({"moved": [diff_as_json(diff) for diff in moved]})
            return
        if not moved:
            click.echo(f"{self.database} is already on the newest snapshot")
        for diff in moved:
            print_diff(diff)
