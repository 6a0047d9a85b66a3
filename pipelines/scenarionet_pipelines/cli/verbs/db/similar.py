"""``scenarionet db similar``: list the scenarios that are most like another."""

from __future__ import annotations

import click

from scenarionet_pipelines.cli.output import table
from scenarionet_pipelines.cli.verb import DATABASE, LakeVerb, argument, option


class SimilarVerb(LakeVerb):
    """List the scenarios that are most like another by an embedding, the nearest first.

    ID is a scenario's id or a part of it that only one has. To save them as a database, filter with --order-by
    "distance_to(NAME, 'ID')" and --limit.
    """

    examples = (
        "scenarionet db similar lake pg/v2/7 --by v",
        "scenarionet db similar lake pg/v2/7 -k 20 --database busy --json",
    )
    scenario_id: str = argument("ID")
    k: int = option("How many.", "-k", default=10, type=click.IntRange(1), metavar="N")
    by: str | None = option("The embedding. [default: the only one of the lake]", metavar="NAME")
    database: str | None = DATABASE

    def run(self) -> None:
        found = self.open().similar(self.scenario_id, self.k, by=self.by, database=self.database).to_dicts()
        lines = table([(row["scenario_id"], row["distance"]) for row in found], ("scenario", "distance"))
        self.say({"similar": found}, lines)
