"""``scenarionet forecast fit``: train a forecaster on the scenarios of a database."""

from __future__ import annotations

from scenarionet_data.errors import needing
from scenarionet_pipelines.cli.epochs import EpochsVerb
from scenarionet_pipelines.cli.parameters import pairs
from scenarionet_pipelines.cli.verb import option


class FitVerb(EpochsVerb):
    """Train a forecaster: a compact transformer that predicts trajectories of all moving road users of a database.

    Settings are those of ForecasterConfig in scenarionet_data.forecasts.forecaster; -p changes one, for example
    -p epochs=2. Run the same command again to continue after an interruption; the weights at the end are the same.

    Checkpoints, settings and the curve are kept in the lake under the name of the run: the view `training` has a row
    for each epoch. `scenarionet forecast score LAKE --model RUN --database DATABASE` scores the forecaster.
    """

    examples = (
        "scenarionet forecast fit lake driven_train --test driven_val -p epochs=20",
        "scenarionet forecast fit lake driven_train --name small -p size=32 -p layers=1 --seed 1",
        "scenarionet forecast fit lake driven_train --order-by 'difficulty DESC' --limit 1000",
    )
    name: str | None = option("Name of the run. [default: DATABASE-forecaster-seedN]", metavar="NAME")

    def run(self) -> None:
        with needing("a forecaster needs torch", "learn"):
            from scenarionet_data.forecasts.forecaster import ForecasterConfig, train
        config = ForecasterConfig.parse(pairs(self.parameters, "-p"))
        run = self.name or f"{self.source(self.database)}-forecaster-seed{self.seed}".replace("@", ".")
        following = f"scenarionet forecast score {self.lake} --model {run} --database NAME"
        self.fit(run, config, train, following)
