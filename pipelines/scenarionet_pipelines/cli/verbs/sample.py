"""``scenarionet sample``: save a random sample of a database."""

from __future__ import annotations

from scenarionet_pipelines.cli.databases import described
from scenarionet_pipelines.cli.verb import OPTIONAL_DATABASE, Choosing, LakeVerb, Saving, option


class SampleVerb(LakeVerb, Choosing, Saving):
    """Save a random sample of a database, or of the whole lake, drawn without replacement.

    The same seed draws the same scenarios on every machine. They keep the order of the database; with --levels, a
    curriculum, they are sorted by difficulty.
    """

    examples = (
        "scenarionet sample lake busy -n 1000 --name few",
        "scenarionet sample lake --fraction 0.01 --stratify dataset --name tiny",
        "scenarionet sample lake busy -n 500 --balance city --weights difficulty --seed 3 --name hard",
        "scenarionet sample lake busy -n 500 --levels 5 --name curriculum",
        "scenarionet sample lake busy --order-by 'difficulty DESC' --limit 1000 -n 100 --name hard_ones",
    )
    database: str | None = OPTIONAL_DATABASE
    n: int | None = option("Number of scenarios.", "-n", metavar="N")
    fraction: float | None = option("Number of scenarios as a fraction of the database.")
    seed: int = option("Seed of the random numbers.", default=0)
    weights: str = option("Sampling weight: SQL expression over the columns of metadata.", default="1", metavar="EXPR")
    stratify: str | None = option("Keep the proportions of this column's values.", metavar="COLUMN")
    balance: str | None = option(
        "Draw equally often from each value of this column, as far as possible.", metavar="COLUMN"
    )
    levels: int | None = option(
        "Draw equally often from N levels of difficulty, sorted from easy to difficult.", metavar="N"
    )

    def run(self) -> None:
        lake = self.open()
        self.say(*described(lake.sample(**self.given(lake.sample) | {"database": self.selection(self.database)})))
