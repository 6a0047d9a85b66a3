"""What verbs that train a network on the scenarios of a database share: options, progress by epoch, and the curve."""

from __future__ import annotations

import json
from collections.abc import Callable
from typing import Any

from scenarionet_pipelines.cli.interrupt import keeping
from scenarionet_pipelines.cli.output import count
from scenarionet_pipelines.cli.verb import PARAMETERS, Choosing, DatabaseVerb, Progressing, option


class EpochsVerb(DatabaseVerb, Choosing, Progressing):
    """A verb that trains a network for some epochs."""

    seed: int = option("Seed of weights, order and random changes of samples.", default=0)
    parameters: tuple[str, ...] = PARAMETERS
    tests: tuple[str, ...] = option("Measure on this database after each epoch; repeatable.", "--test", metavar="NAME")

    def fit(self, run: str, epochs: int, train: Callable[..., object], following: str) -> None:
        """Train, and print the means of each epoch.

        Args:
            run: Name of the run.
            epochs: Number of epochs.
            train: Takes lake, database, run, seed, tests and what is called with the rows of each epoch.
            following: The command that uses what was learned.
        """
        curve: list[dict[str, Any]] = []
        with self.progress(f"train {run}", "epoch") as progress, keeping(lambda: f"checkpoints are kept in run {run}"):
            progress.update(0, epochs)

            def note(rows: list[dict[str, Any]]) -> None:
                curve.extend(rows)
                progress.update(rows[0]["round"], epochs)

            train(self.open(), self.saved(self.database), run=run, seed=self.seed, tests=self.tests, on_epoch=note)
        lines = []
        for row in curve:
            numbers = ", ".join(f"{name} {value:.3f}" for name, value in json.loads(row["learned"]).items())
            lines.append(f"epoch {row['round']}/{epochs}  {row['test'] or 'training'}: {numbers}")
        self.say(
            {"run": run, "curve": curve, "next": following},
            [*lines, f"run {run}: {count(epochs, 'epoch')}. Use it: {following}"],
        )
