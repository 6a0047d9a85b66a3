"""``scenarionet traffic generate``: make scenarios of traffic on the maps of a database."""

from __future__ import annotations

from scenarionet_pipelines.cli.conversion_report import report_content
from scenarionet_pipelines.cli.verb import REPLACE, Choosing, DatabaseVerb, Distributed, option


class GenerateVerb(DatabaseVerb, Choosing, Distributed):
    """Make scenarios with a model of traffic on the maps of a database, and store them in the lake.

    They are version NAME of the dataset generated. Around the ego of each scenario of DATABASE, the model places
    vehicles on lanes, one after the other, and moves them; for those that leave the map, others come. A scenario keeps
    the map, split and log of its parent, and nothing else. extras has parent and generated: the model, the hash of its
    weights, and the seed.

    The same command makes the same scenarios, and goes on where it was interrupted.
    """

    examples = (
        "scenarionet traffic generate lake recorded_val --model traffic --name first",
        "scenarionet traffic generate lake recorded_val --model traffic --name long --number 10 --duration 60 --seed 1",
        "scenarionet traffic generate lake recorded_val --model traffic --name dense --vehicles 20 --workers 2",
    )
    model: str = option("Run that `traffic learn` trained.", metavar="RUN")
    name: str = option("Name of the generated scenarios.", metavar="NAME")
    number: int = option("Scenarios for each of the database.", default=1)
    seed: int = option("Seed of the draws.", default=0)
    vehicles: int = option("Vehicles at the start; 0: as many as are recorded near the ego, at least 8.", default=0)
    duration: float = option("Length of a scenario [s].", default=20.0)
    replace: bool = REPLACE

    def run(self) -> bool:
        from scenarionet_data.execution.executors import executor_for

        try:
            from scenarionet_data.generation.writing import GenerationChoice, generate
        except ModuleNotFoundError as error:
            from scenarionet_data.errors import MissingDependency

            raise MissingDependency("a model of traffic needs torch", "learn") from error
        with self.execution() as execution, self.progress(f"generate {self.name}", "shard") as progress:
            report = generate(
                self.lake, self.saved(self.database), self.model, GenerationChoice(**self.given(GenerationChoice)),
                name=self.name, replace=self.replace, executor=execution.executor or executor_for(self.num_workers),
                on_progress=progress.update,
            )  # fmt: skip
        self.say(*report_content(report, self.lake))
        return not report.failed
