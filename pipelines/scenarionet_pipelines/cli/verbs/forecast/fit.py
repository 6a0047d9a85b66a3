"""``scenarionet forecast fit``: train a forecaster on the scenarios of a database."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING, Any

from scenarionet_data.errors import needing
from scenarionet_pipelines.cli.interrupt import keeping
from scenarionet_pipelines.cli.output import count
from scenarionet_pipelines.cli.parameters import pairs
from scenarionet_pipelines.cli.verb import PARAMETERS, DatabaseVerb, Progressing, option

if TYPE_CHECKING:
    from scenarionet_data.forecasts.forecaster import ForecasterConfig


class FitVerb(DatabaseVerb, Progressing):
    """Train a forecaster: a compact transformer that predicts trajectories of all moving road users of a database.

    Settings are those of ForecasterConfig in scenarionet_data.forecasts.forecaster; -p changes one, for example
    -p epochs=2. Run the same command again to continue after an interruption; the weights at the end are the same.

    Checkpoints, settings and the curve are kept in the lake under the name of the run: the view `training` has a row
    for each epoch. `scenarionet forecast score LAKE --model RUN --database DATABASE` scores the forecaster.
    """

    examples = (
        "scenarionet forecast fit lake driven_train --test driven_val -p epochs=20",
        "scenarionet forecast fit lake driven_train --name small -p size=32 -p layers=1 --seed 1",
    )
    name: str | None = option("Name of the run. [default: DATABASE-forecaster-seedN]", metavar="NAME")
    seed: int = option("Seed of weights, order and augmentation.", default=0)
    parameters: tuple[str, ...] = PARAMETERS
    tests: tuple[str, ...] = option("Measure on this database after each epoch; repeatable.", "--test", metavar="NAME")

    def run(self) -> None:
        with needing("a forecaster needs torch", "learn"):
            from scenarionet_data.forecasts.forecaster import make_config, train
        config: ForecasterConfig = make_config(pairs(self.parameters, "-p"))
        run = self.name or f"{self.database}-forecaster-seed{self.seed}".replace("@", ".")
        curve: list[dict[str, Any]] = []
        with self.progress(f"fit {run}", "epoch") as progress, keeping(lambda: f"checkpoints are kept in run {run}"):

            def note(rows: list[dict[str, Any]]) -> None:
                curve.extend(rows)
                progress.update(rows[0]["round"], config.epochs, 0)

            train(self.open(), self.database, config, run=run, seed=self.seed, tests=self.tests, on_epoch=note)
        lines = []
        for row in curve:
            numbers = ", ".join(f"{name} {value:.3f}" for name, value in json.loads(row["learned"]).items())
            lines.append(f"epoch {row['round']}/{config.epochs}  {row['test'] or 'training'}: {numbers}")
        score = f"scenarionet forecast score {self.lake} --model {run} --database NAME"
        self.say(
            {"run": run, "curve": curve, "next": score},
            [*lines, f"run {run}: {count(config.epochs, 'epoch')}. Score it: {score}"],
        )
