"""``scenarionet merge``: save the union of several databases."""

from __future__ import annotations

from scenarionet_pipelines.cli.databases import described
from scenarionet_pipelines.cli.output import count
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
        lake = self.open()
        created = self.combined(lake.merge)
        repeated = sum(len(lake.database(parent)) for parent in created.lineage.parents) - len(created)
        content, line = described(created)
        left_out = [f"left out: {count(repeated, 'repeated scenario')}"] if repeated else []
        self.say(content | {"repeated": repeated}, [line, *left_out])
