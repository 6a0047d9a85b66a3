"""``scenarionet train``: train a driver on the scenarios of a database."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

from scenarionet_data.errors import needing
from scenarionet_pipelines.cli.interrupt import keeping
from scenarionet_pipelines.cli.output import count, duration, size, table
from scenarionet_pipelines.cli.parameters import pairs
from scenarionet_pipelines.cli.verb import OPTIONAL_DATABASE, PARAMETERS, Choosing, Progressing, argument, option
from scenarionet_pipelines.messages import one_line

if TYPE_CHECKING:
    from scenarionet_sim.learning.training import TrainingReport


class TrainVerb(Choosing, Progressing):
    """Train a driver on the scenarios of a database, or of the whole lake.

    ALGORITHM is ppo, td3, ippo, copo, gail, airl, dagger, or module:Class for settings of your own.

    Settings are those that were published, --size small those for one processor core; -p changes one of them, for
    example -p steps=200_000.

    The view `training` has a row for each round: success, route completion, cost and times. Checkpoints are in the
    lake, too, and `scenarionet sim LAKE DATABASE --policy runs/NAME` evaluates the driver.

    Run the same command again to continue after an interruption; the weights at the end are the same.
    """

    examples = (
        "scenarionet train ppo lake busy_train --seed 0 --size small --test busy_val",
        "scenarionet train ppo lake busy_train -p steps=200_000 -p levels=10 -p traffic=idm --name curriculum",
        "scenarionet train copo lake busy_train --size small",
        "scenarionet train ppo lake busy_train --order-by 'difficulty DESC' --limit 1000 --size small",
        "scenarionet train gail lake busy_train --size small --observations busy_train-vehicles-observed",
    )
    algorithm: str = argument()
    lake: str = argument()
    database: str | None = OPTIONAL_DATABASE
    seed: int = option("Seed of weights, actions and scenarios.", default=0)
    name: str | None = option("Name of the run. [default: DATABASE-ALGORITHM-seedN]", metavar="NAME")
    size: str = option("Settings as published, or for one processor core.", choices=("paper", "small"), default="paper")
    parameters: tuple[str, ...] = PARAMETERS
    tests: tuple[str, ...] = option(
        "Test on this database at each checkpoint; repeatable.", "--test", metavar="DATABASE"
    )
    observations: str | None = option(
        "Observations of experts, recorded by `scenarionet runs record`; for gail, airl.", metavar="RUN"
    )
    onnx: str | None = option("Write the trained driver as ONNX.", metavar="FILE")

    def run(self) -> None:
        from scenarionet_data.storage.files.places import open_files
        from scenarionet_sim.drivers.trained import load_driver
        from scenarionet_sim.learning.config import make_learner_config

        config = make_learner_config(self.algorithm, self.size, pairs(self.parameters, "-p"))
        with needing("learning needs torch", "learn"):
            from scenarionet_sim.learning.training import plan_training, run_training
        training = plan_training(**self.given(plan_training) | {"database": self.saved(self.database)}, config=config)
        named = f"{self.source(self.database)}-{self.algorithm}-seed{self.seed}"
        run = self.name or named.replace("@", ".").replace(":", ".")
        with self.progress(f"train {run}", "step") as progress, keeping(lambda: f"checkpoints are kept in run {run}"):
            report = run_training(training, run, lambda row: progress.update(row["steps"], config.steps))
        if self.onnx is not None:
            load_driver(open_files(self.lake), f"runs/{run}").export_onnx(self.onnx)
        query = f"SELECT steps, success, route_completion, cost FROM training WHERE run = '{run}' ORDER BY steps"
        curve = f'scenarionet sql {self.lake} "{query}"'
        whole = f"run {run}: {count(report.steps, 'step')}, took {duration(report.seconds)}. Curve: {curve}"
        self.say(vars(report) | {"speed": report.speed, "next": curve}, [*report_lines(report), whole])
        self.complain(f"left out: {each}: {one_line(reason)}" for each, reason in report.skipped.items())


def report_lines(report: TrainingReport) -> Iterator[str]:
    """Yield the results of the last round and of the tests, and where time and memory went."""
    if report.resumed:
        yield f"continued  after {count(report.resumed, 'step')} of an earlier command"
    names = ("success", "out_of_road", "timeout", "route_completion", "cost", "speed")
    if report.last:
        rows = {"training": report.last, **report.tests}
        yield from table([(title, *(row.get(key) for key in names)) for title, row in rows.items()], ("", *names))
        total = sum(report.times.values()) or 1.0
        shares = ", ".join(f"{activity} {seconds / total:.0%}" for activity, seconds in report.times.items())
        yield f"speed      {report.speed:,.0f} steps/s: {shares}"
        yield f"memory     {size(report.memory)} of experience; disk: at most {size(report.disk)} of checkpoints"
