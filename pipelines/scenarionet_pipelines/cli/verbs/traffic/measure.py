"""``scenarionet traffic measure``: compare the vehicles that a model places with the recorded ones."""

from __future__ import annotations

from dataclasses import asdict

from scenarionet_pipelines.cli.output import table
from scenarionet_pipelines.cli.verb import Choosing, DatabaseVerb, option


class MeasureVerb(DatabaseVerb, Choosing):
    """Compare the vehicles that a model of traffic places with the recorded ones, at all moments of a database.

    The numbers are the maximum mean discrepancies of TrafficGen, of position, heading, speed and size, means over the
    moments; 0 would be the recording itself. Beside the model stand the vehicles of another map, and vehicles that
    are placed uniformly. In brackets: how much higher than the model, with a
    95 % interval over the scenarios.
    """

    examples = (
        "scenarionet traffic measure lake recorded_val --model traffic",
        "scenarionet traffic measure lake recorded_val --model traffic --seed 1 --json",
    )
    model: str = option("Run that `traffic learn` trained.", metavar="RUN")
    seed: int = option("Seed of the draws.", default=0)

    def run(self) -> None:
        try:
            from scenarionet_data.generation.scores import ATTRIBUTES, score_placement
        except ModuleNotFoundError as error:
            from scenarionet_data.errors import MissingDependency

            raise MissingDependency("a model of traffic needs torch", "learn") from error
        scores = score_placement(self.open(), self.model, self.saved(self.database), seed=self.seed)
        rows = []
        for each in scores:
            values = [f"{each.means[attribute]:.4f}" for attribute in ATTRIBUTES]
            if each.touching is None:
                spans = (each.differences[attribute] for attribute in ATTRIBUTES)
                texts = ("{:+.4f}, {:+.4f} ... {:+.4f}".format(*span) for span in spans)
                values = [f"{value} ({text})" for value, text in zip(values, texts, strict=True)]
            rows.append((each.name, *values))
        first = scores[0]
        lines = table(rows, ("vehicles of", *ATTRIBUTES))
        lines.append(
            f"{first.moments:,} moments, {first.vehicles:,} vehicles; {first.touching:.2%} of those drawn first"
            " touch another"
        )
        self.say({"scores": [asdict(each) for each in scores]}, lines)
