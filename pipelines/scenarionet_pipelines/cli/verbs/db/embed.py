"""``scenarionet db embed``: write a vector for each scenario as a user column."""

from __future__ import annotations

from dataclasses import asdict

from scenarionet_pipelines.cli.output import count
from scenarionet_pipelines.cli.verb import OPTIONAL_DATABASE, Choosing, LakeVerb, Progressing, option


class EmbedVerb(LakeVerb, Choosing, Progressing):
    """Write a vector for each scenario of a database, or of the whole lake, as a user column.

    `db similar` finds the scenarios with the nearest vectors, `db overlap --embedding` near-duplicates, and in SQL
    distance_to(NAME, 'ID') is a number to select and sort by.

    The model `features` is 64 numbers that are computed by hand: motion of the ego, road, traffic, interactions and
    lights, each standardised with a stored mean and scale, so that two lakes have comparable vectors. The column's
    source, which `db tag LAKE` shows, has a hash of the model. With --model RUN, the vector is what the encoder of a
    forecaster says of the ego, averaged over the scenario.
    """

    examples = (
        "scenarionet db embed lake --name v",
        "scenarionet db embed lake busy --name v --replace",
        "scenarionet db embed lake --name encoded --model driven_train-forecaster-seed0",
    )
    database: str | None = OPTIONAL_DATABASE
    name: str = option("Name of the user column.", metavar="NAME")
    model: str = option("Model: features, or a run that `forecast fit` trained.", default="features", metavar="NAME")
    replace: bool = option("Save a new version if the column exists.")

    def run(self) -> None:
        opened = self.open()
        with self.progress("embed") as progress:
            column = opened.embed(
                self.name,
                self.selection(self.database),
                model=self.model,
                replace=self.replace,
                on_progress=progress.update,
            )
        what = f"{column.reference}: {column.source}, {column.type} for {count(column.count, 'scenario')}"
        self.say(asdict(column) | {"reference": column.reference}, what)
