"""``scenarionet merge``: save the union of several databases."""

from __future__ import annotations

from dataclasses import asdict

import click

from scenarionet_pipelines.cli.databases import print_created
from scenarionet_pipelines.cli.output import count, print_json
from scenarionet_pipelines.cli.verb import CombinationVerb


class MergeVerb(CombinationVerb):
    """Save the union of several databases, one after the other, each scenario once.

    A scenario that is in several databases keeps the position and weight it has in the first. The number of repeated
    scenarios is printed; `scenarionet db overlap` shows which databases share them.
    """

    examples = (
        "scenarionet merge lake busy far --name both",
        "scenarionet merge lake a b c --name all --replace --json",
    )

    def run(self) -> None:
        from scenarionet_data import Lake

        opened = Lake(self.lake)
        created = opened.merge(*self.databases, name=self.name, replace=self.replace, allow_empty=self.allow_empty)
        repeated = sum(len(opened.database(parent)) for parent in created.lineage.parents) - len(created)
        if self.as_json:
            print_json(
                {"name": created.name, "reference": created.reference, "repeated": repeated} | asdict(created.lineage)
            )
            return
        print_created(created, self.as_json)
        if repeated:
            click.echo(f"left out: {count(repeated, 'repeated scenario')}")
