"""``scenarionet db subtract``: save the scenarios of one database that others do not contain."""

from __future__ import annotations

from scenarionet_pipelines.cli.databases import print_created
from scenarionet_pipelines.cli.verb import CombinationVerb


class SubtractVerb(CombinationVerb):
    """Save the scenarios of the first database that are in none of the others, in its order."""

    examples = (
        "scenarionet db subtract lake busy seen --name unseen",
        "scenarionet db subtract lake a b c --name rest",
    )

    def run(self) -> None:
        from scenarionet_data import Lake

        print_created(
            Lake(self.lake).subtract(
                *self.databases, name=self.name, replace=self.replace, allow_empty=self.allow_empty
            ),
            self.as_json,
        )
