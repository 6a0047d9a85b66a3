"""``scenarionet db rebuild``: verify that a database's query still selects its members."""

from __future__ import annotations

import click

from scenarionet_pipelines.cli.databases import diff_as_json, print_diff
from scenarionet_pipelines.cli.output import count, print_json
from scenarionet_pipelines.cli.verb import DatabaseVerb


class RebuildVerb(DatabaseVerb):
    """Run a database's query again on its snapshot and parents, and compare the result.

    Nothing is saved. The exit code is 1 if members, weights or order differ.
    """

    examples = (
        "scenarionet db rebuild lake busy",
        "scenarionet db rebuild lake busy@1 --json",
    )

    def run(self) -> bool:
        from scenarionet_data import Lake

        rebuilt = Lake(self.lake).rebuild(self.database)
        if self.as_json:
            print_json({"reference": rebuilt.reference, "is_same": rebuilt.is_same} | diff_as_json(rebuilt.diff))
        elif rebuilt.is_same:
            click.echo(f"{rebuilt.reference}: the same {count(rebuilt.diff.counts[0], 'scenario')} in the same order")
        else:
            click.echo(f"{rebuilt.reference}: NOT the same")
            print_diff(rebuilt.diff)
        return rebuilt.is_same
