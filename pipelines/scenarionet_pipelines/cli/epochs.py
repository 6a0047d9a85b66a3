"""What verbs that train a network on the scenarios of a database share: options, progress by epoch, and the curve."""

from __future__ import annotations

import json
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

from scenarionet_pipelines.cli.interrupt import keeping
from scenarionet_pipelines.cli.output import count
from scenarionet_pipelines.cli.verb import PARAMETERS, Choosing, DatabaseVerb, Progressing, option

if TYPE_CHECKING:
    from scenarionet_data.learning.fitting import FitConfig, FitRun


class EpochsVerb(DatabaseVerb, Choosing, Progressing):
    """A verb that trains a network for some epochs."""

    seed: int = option("Seed of weights, order and random changes of samples.", default=0)
    parameters: tuple[str, ...] = PARAMETERS
    tests: tuple[str, ...] = option("Measure on this database after each epoch; repeatable.", "--test", metavar="NAME")

    def fit(self, run: str, config: FitConfig, train: Callable[[FitRun, Any], object], following: str) -> None:
        """Train, and print the means of each epoch.

        Args:
            run: Name of the run.
            config: Settings.
            train: Trains, given the run and the settings.
            following: The command that uses what was learned.
        """
        from scenarionet_data.learning.fitting import FitRun  # needs torch

        epochs, device = config.epochs, config.device.type
        curve: list[dict[str, Any]] = []
        with (
            self.progress(f"train {run} on {device}", "epoch") as progress,
            keeping(lambda: f"checkpoints are kept in run {run}"),
        ):
            progress.update(0, epochs)

            def note(rows: list[dict[str, Any]]) -> None:
                curve.extend(rows)
                progress.update(rows[0]["round"], epochs)

            train(FitRun(self.open(), self.saved(self.database), run, self.seed, self.tests, note), config)
        lines = []
        for row in curve:
            numbers = ", ".join(f"{name} {value:.3f}" for name, value in json.loads(row["learned"]).items())
            lines.append(f"epoch {row['round']}/{epochs}  {row['test'] or 'training'}: {numbers}")
        self.say(
            {"run": run, "device": device, "curve": curve, "next": following},
            [*lines, f"run {run}: {count(epochs, 'epoch')} on {device}. Use it: {following}"],
        )
