"""``scenarionet traffic learn``: train a model of traffic on the scenarios of a database."""

from __future__ import annotations

import json
from typing import Any

from scenarionet_pipelines.cli.interrupt import keeping
from scenarionet_pipelines.cli.output import count
from scenarionet_pipelines.cli.parameters import pairs
from scenarionet_pipelines.cli.verb import PARAMETERS, DatabaseVerb, Progressing, option


class LearnVerb(DatabaseVerb, Progressing):
    """Train a model of traffic: where vehicles stand on lanes, how fast and how large they are, and how they move.

    Settings are those of TrafficConfig in scenarionet_data.generation.snapshots; -p changes one, for example
    -p epochs=2. Run the same command again to continue after an interruption; the weights at the end are the same.

    Checkpoints, settings and the curve are kept in the lake under the name of the run: the view `training` has a row
    for each epoch. `scenarionet traffic generate LAKE DATABASE --model RUN --name NAME` makes scenarios with it.
    """

    examples = (
        "scenarionet traffic learn lake recorded_train --test recorded_val --name traffic",
        "scenarionet traffic learn lake recorded_train --name small -p size=32 -p epochs=2 --seed 1",
    )
    name: str = option("Name of the run.", metavar="NAME")
    seed: int = option("Seed of weights, order and contexts.", default=0)
    parameters: tuple[str, ...] = PARAMETERS
    tests: tuple[str, ...] = option("Measure on this database after each epoch; repeatable.", "--test", metavar="NAME")

    def run(self) -> None:
        try:
            from scenarionet_data.generation.training import make_config, train
        except ModuleNotFoundError as error:
            from scenarionet_data.errors import MissingDependency

            raise MissingDependency("a model of traffic needs torch", "learn") from error
        config = make_config(pairs(self.parameters, "-p"))
        curve: list[dict[str, Any]] = []
        kept = keeping(lambda: f"checkpoints are kept in run {self.name}")
        with self.progress(f"learn {self.name}", "epoch") as progress, kept:

            def note(rows: list[dict[str, Any]]) -> None:
                curve.extend(rows)
                progress.update(rows[0]["round"], config.epochs, 0)

            train(
                self.open(), self.database, config, run=self.name, seed=self.seed, tests=self.tests, on_epoch=note,
            )  # fmt: skip
        lines = []
        for row in curve:
            numbers = ", ".join(f"{name} {value:.3f}" for name, value in json.loads(row["learned"]).items())
            lines.append(f"epoch {row['round']}/{config.epochs}  {row['test'] or 'training'}: {numbers}")
        following = f"scenarionet traffic generate {self.lake} DATABASE --model {self.name} --name NAME"
        self.say(
            {"run": self.name, "curve": curve, "next": following},
            [*lines, f"run {self.name}: {count(config.epochs, 'epoch')}. Make scenarios: {following}"],
        )
