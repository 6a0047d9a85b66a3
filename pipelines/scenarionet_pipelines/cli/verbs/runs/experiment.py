"""``scenarionet runs experiment``: the paper's learning experiments, from one command each."""

from __future__ import annotations

import subprocess
from importlib.util import find_spec
from pathlib import Path

import click

from scenarionet_pipelines.cli.interrupt import keeping
from scenarionet_pipelines.cli.output import count
from scenarionet_pipelines.cli.verb import Distributed, argument, option


class ExperimentVerb(Distributed):
    """Train and test drivers as in the paper, and write a page with tables, curves and computed verdicts.

    Small experiments make their own scenarios in LAKE; those of the paper's size expect the databases recorded_train,
    recorded_val and recorded_test, and generated_ and both_ ones likewise.

    Runs are kept in the lake: run the same command again to continue after an interruption.
    """

    examples = (
        "scenarionet runs experiment cross-dataset lake -o cross_dataset",
        "scenarionet runs experiment cross-dataset lake --recorded recorded -o cross_dataset --workers 2",
        "scenarionet runs experiment multi-agent lake -o multi_agent --cluster local",
    )
    name: str = argument(type=click.Choice(("cross-dataset", "multi-agent")))
    lake: str = argument()
    out: str = option("Folder of the page, its figures and Parquet files.", "-o", "--out", metavar="FOLDER")
    size: str = option(
        "On generated scenarios and one core, or with the datasets and steps of the paper.",
        choices=("small", "paper"),
        default="small",
    )
    recorded: str | None = option("Recorded scenarios of the lake as another test; cross-dataset.", metavar="DATABASE")

    def run(self) -> None:
        from scenarionet_data import Lake
        from scenarionet_data.errors import MissingDependency
        from scenarionet_sim.learning.experiments.comparison import run_comparison
        from scenarionet_sim.learning.experiments.cross_dataset import cross_dataset, prepare
        from scenarionet_sim.learning.experiments.multi_agent import multi_agent, prepare_experts
        from scenarionet_sim.learning.experiments.page import write_page

        if find_spec("torch") is None:
            raise MissingDependency("learning needs torch", "learn")
        num_workers = self.num_workers
        if self.size == "small":
            (prepare if self.name == "cross-dataset" else prepare_experts)(self.lake, num_workers)
        prefix = "standin" if self.size == "small" else "recorded"
        comparison = (
            cross_dataset(self.size, self.recorded) if self.name == "cross-dataset" else multi_agent(self.size, prefix)
        )
        begun = Path(self.out) / "commit.txt"
        if not begun.exists():  # the configuration is that of the first run
            begun.parent.mkdir(parents=True, exist_ok=True)
            begun.write_text(commit(), "utf-8")
        total = len(comparison.arms) * len(comparison.seeds)
        with (
            self.execution() as execution,
            self.progress(f"experiment {self.name}", "training") as progress,
            keeping(lambda: "checkpoints are kept"),
        ):
            run_comparison(
                self.lake, comparison, workers=num_workers, executor=execution.executor,
                on_progress=lambda done, total, _: progress.update(done, total),
            )  # fmt: skip
        page = write_page(Lake(self.lake), comparison, self.out, begun.read_text("utf-8"))
        content = {"experiment": self.name, "size": self.size, "trainings": total, "page": str(page)}
        self.say(content, f"{page}: {count(total, 'training')}")


def commit() -> str:
    """Return the commit of this checkout, or the version that is installed."""
    from scenarionet_data import version

    here = Path(__file__).parents[4]
    words = ["git", "-C", str(here), "rev-parse", "--short", "HEAD"]
    try:
        done = subprocess.run(words, capture_output=True, text=True, check=False)  # noqa: S603
    except FileNotFoundError:
        return version.name_and_version()
    return done.stdout.strip() or version.name_and_version()
