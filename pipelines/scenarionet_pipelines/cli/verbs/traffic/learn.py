"""``scenarionet traffic learn``: train a model of traffic on the scenarios of a database."""

from __future__ import annotations

from functools import partial

import click

from scenarionet_data.errors import needing
from scenarionet_pipelines.cli.epochs import EpochsVerb
from scenarionet_pipelines.cli.parameters import pairs
from scenarionet_pipelines.cli.verb import option


class LearnVerb(EpochsVerb):
    """Train a model of traffic: where vehicles stand on lanes, how fast and how large they are, and how they move.

    With --kind tokens it is a model of motion alone, for `sim --traffic model:RUN`: every half second, each road user
    takes one of 2,048 recorded motions. It learns on a GPU if there is one, and says on what.

    Settings are those of TrafficConfig in scenarionet_data.generation.snapshots, or of TokenConfig in
    scenarionet_data.generation.token_model; -p changes one, for example -p epochs=2. Run the same command again to
    continue after an interruption; the weights at the end are the same.

    Checkpoints, settings and the curve are kept in the lake under the name of the run: the view `training` has a row
    for each epoch. `scenarionet traffic generate LAKE DATABASE --model RUN --name NAME` makes scenarios with it.
    """

    examples = (
        "scenarionet traffic learn lake recorded_train --test recorded_val --name traffic",
        "scenarionet traffic learn lake recorded_train --name small -p size=32 -p epochs=2 --seed 1",
        "scenarionet traffic learn lake recorded_train --kind tokens --name clone",
        "scenarionet traffic learn lake recorded_train --kind tokens --start clone -p choices=32 --name tuned",
    )
    kind: str = option(
        "What is learned: where vehicles are placed and how they move, or how road users move by tokens.",
        choices=("traffic", "tokens"),
        default="traffic",
    )
    start: str | None = option("With --kind tokens: begin with the weights and tokens of this run.", metavar="RUN")
    name: str = option("Name of the run.", metavar="NAME")

    def run(self) -> None:
        if self.start is not None and self.kind != "tokens":
            raise click.UsageError("--start belongs to --kind tokens")
        with needing("a model of traffic needs torch", "learn"):
            from scenarionet_data.generation import token_recordings, training
            from scenarionet_data.generation.snapshots import TrafficConfig
            from scenarionet_data.generation.token_model import TokenConfig
        given = pairs(self.parameters, "-p")
        if self.kind == "tokens":
            following = f"scenarionet sim {self.lake} DATABASE --policy idm --traffic model:{self.name}"
            learn = partial(token_recordings.train, start=self.start)
            self.fit(self.name, TokenConfig.parse(given), learn, following)
        else:
            following = f"scenarionet traffic generate {self.lake} DATABASE --model {self.name} --name NAME"
            self.fit(self.name, TrafficConfig.parse(given), training.train, following)
