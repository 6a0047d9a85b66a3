"""``scenarionet db checkout``: restore an earlier version of a database."""

from __future__ import annotations

from scenarionet_pipelines.cli.databases import print_created
from scenarionet_pipelines.cli.verb import LakeVerb, argument


class CheckoutVerb(LakeVerb):
    """Restore an earlier version of a database as its newest version.

    The versions in between are kept. To only read an earlier version, pass DATABASE@VERSION to any verb.
    """

    examples = (
        "scenarionet db checkout lake busy@1",
        "scenarionet db checkout lake busy@1 --json",
    )
    database: str = argument("DATABASE@VERSION")

    def run(self) -> None:
        from scenarionet_data import Lake

        print_created(Lake(self.lake).checkout(self.database), self.as_json)
