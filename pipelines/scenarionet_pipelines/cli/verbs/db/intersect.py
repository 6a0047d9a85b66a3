"""``scenarionet db intersect``: save the scenarios that several databases have in common."""

from __future__ import annotations

from scenarionet_pipelines.cli.databases import print_created
from scenarionet_pipelines.cli.verb import CombinationVerb


class IntersectVerb(CombinationVerb):
    """Save the scenarios that are in every one of the databases, in the order of the first."""

    examples = (
        "scenarionet db intersect lake busy far --name both",
        "scenarionet db intersect lake busy@1 busy --name still_busy",
    )

    def run(self) -> None:
        from scenarionet_data import Lake

        print_created(
            Lake(self.lake).intersect(
                *self.databases, name=self.name, replace=self.replace, allow_empty=self.allow_empty
            ),
            self.as_json,
        )
