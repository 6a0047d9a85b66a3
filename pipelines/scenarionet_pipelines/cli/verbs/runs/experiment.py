"""``scenarionet runs experiment``: the paper's learning experiments, from one command each."""

from __future__ import annotations

import subprocess
from importlib.util import find_spec
from pathlib import Path

import click

from scenarionet_pipelines.cli.execution import executor_from_options
from scenarionet_pipelines.cli.group import verb
from scenarionet_pipelines.cli.interrupt import Interrupted
from scenarionet_pipelines.cli.output import count, print_json
from scenarionet_pipelines.cli.parameters import (
    cluster_option,
    json_option,
    lake_argument,
    quiet_option,
    workers_option,
)
from scenarionet_pipelines.cli.progress import ProgressDisplay


@verb(
    "experiment",
    "scenarionet runs experiment cross-dataset lake -o cross_dataset",
    "scenarionet runs experiment cross-dataset lake --recorded recorded -o cross_dataset --workers 2",
    "scenarionet runs experiment multi-agent lake -o multi_agent --cluster local",
)
@click.argument("name", type=click.Choice(["cross-dataset", "multi-agent"]))
@lake_argument
@click.option("-o", "--out", required=True, metavar="FOLDER", help="Folder of the page, its figures and Parquet files.")
@click.option(
    "--size",
    type=click.Choice(["small", "paper"]),
    default="small",
    show_default=True,
    help="On generated scenarios and one core, or with the datasets and steps of the paper.",
)
@click.option("--recorded", metavar="DATABASE", help="Recorded scenarios of the lake as another test; cross-dataset.")
@workers_option
@cluster_option
@json_option
@quiet_option
def command(
    name: str,
    lake: str,
    out: str,
    size: str,
    recorded: str | None,
    workers: int | None,
    cluster: str | None,
    as_json: bool,
    quiet: bool,
) -> None:
    """Train and test drivers as in the paper, and write a page with tables, curves and computed verdicts.

    Small experiments make their own scenarios in LAKE; those of the paper's size expect the databases recorded_train,
    recorded_val and recorded_test, and generated_ and both_ ones likewise.

    Runs are kept in the lake: run the same command again to continue after an interruption.
    """
    from scenarionet_data import Lake
    from scenarionet_data.errors import MissingDependency
    from scenarionet_pipelines.machine import default_workers
    from scenarionet_sim.learning.experiments.comparison import run_comparison
    from scenarionet_sim.learning.experiments.cross_dataset import cross_dataset, prepare
    from scenarionet_sim.learning.experiments.multi_agent import multi_agent, prepare_experts
    from scenarionet_sim.learning.experiments.page import write_page

    if find_spec("torch") is None:
        raise MissingDependency("learning needs torch", "learn")
    num_workers = workers or default_workers()
    if size == "small":
        (prepare if name == "cross-dataset" else prepare_experts)(lake, num_workers)
    prefix = "standin" if size == "small" else "recorded"
    comparison = cross_dataset(size, recorded) if name == "cross-dataset" else multi_agent(size, prefix)
    begun = Path(out) / "commit.txt"
    if not begun.exists():  # the configuration is that of the first run
        begun.parent.mkdir(parents=True, exist_ok=True)
        begun.write_text(_commit(), "utf-8")
    total = len(comparison.arms) * len(comparison.seeds)
    with (
        executor_from_options(cluster, workers, quiet=quiet) as execution,
        ProgressDisplay(f"experiment {name}", "training", is_quiet=quiet) as progress,
    ):
        try:
            run_comparison(
                lake, comparison, workers=num_workers, executor=execution.executor,
                on_progress=lambda done, total, _: progress.update(done, total),
            )  # fmt: skip
        except KeyboardInterrupt as error:
            raise Interrupted("checkpoints are kept; run the same command again to continue") from error
    page = write_page(Lake(lake), comparison, out, begun.read_text("utf-8"))
    if as_json:
        print_json({"experiment": name, "size": size, "trainings": total, "page": str(page)})
    else:
        click.echo(f"{page}: {count(total, 'training')}")


def _commit() -> str:
    """Return the commit of this checkout, or the version that is installed."""
    from scenarionet_data import version

    here = Path(__file__).parents[4]
    words = ["git", "-C", str(here), "rev-parse", "--short", "HEAD"]
    try:
        done = subprocess.run(words, capture_output=True, text=True, check=False)  # noqa: S603
    except FileNotFoundError:
        return version.name_and_version()
    return done.stdout.strip() or version.name_and_version()
