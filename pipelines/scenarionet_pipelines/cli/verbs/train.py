"""``scenarionet train``: train a driver on the scenarios of a database."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import click

from scenarionet_pipelines.cli.advice import one_line
from scenarionet_pipelines.cli.group import verb
from scenarionet_pipelines.cli.interrupt import Interrupted
from scenarionet_pipelines.cli.output import count, duration, print_json, print_table, size
from scenarionet_pipelines.cli.parameters import (
    json_option,
    lake_argument,
    optional_database_argument,
    pairs,
    parameter_option,
    quiet_option,
)
from scenarionet_pipelines.cli.progress import ProgressDisplay

if TYPE_CHECKING:
    from collections.abc import Mapping

    from scenarionet_sim.learning.training import TrainingReport

_MAX_EXAMPLES = 5


@verb(
    "train",
    "scenarionet train ppo lake busy_train --seed 0 --size small --test busy_val",
    "scenarionet train ppo lake busy_train -p steps=200_000 -p levels=10 -p traffic=idm --name curriculum",
    "scenarionet train copo lake busy_train --size small",
    "scenarionet train gail lake busy_train --size small --observations busy_train-vehicles-observed",
)
@click.argument("algorithm")
@lake_argument
@optional_database_argument
@click.option("--seed", type=int, default=0, show_default=True, help="Seed of weights, actions and scenarios.")
@click.option("--name", metavar="NAME", help="Name of the run. [default: DATABASE-ALGORITHM-seedN]")
@click.option(
    "--size",
    type=click.Choice(["paper", "small"]),
    default="paper",
    show_default=True,
    help="Settings as published, or for one processor core.",
)
@parameter_option
@click.option(
    "--test", "tests", multiple=True, metavar="DATABASE", help="Test on this database at each checkpoint; repeatable."
)
@click.option(
    "--observations",
    metavar="RUN",
    help="Observations of experts, recorded by `scenarionet runs record`; for gail, airl.",
)
@click.option("--onnx", metavar="FILE", help="Write the trained driver as ONNX.")
@json_option
@quiet_option
def command(
    algorithm: str,
    lake: str,
    database: str | None,
    seed: int,
    name: str | None,
    size: str,
    parameters: tuple[str, ...],
    tests: tuple[str, ...],
    observations: str | None,
    onnx: str | None,
    as_json: bool,
    quiet: bool,
) -> None:
    """Train a driver on the scenarios of a database, or of the whole lake.

    ALGORITHM is ppo, td3, ippo, copo, gail, airl, or module:Class for settings of your own.

    Settings are those that were published, --size small those for one processor core; -p changes one of them, for
    example -p steps=200_000.

    The view `training` has a row for each round: success, route completion, cost and times. Checkpoints are in the
    lake, too, and `scenarionet sim LAKE DATABASE --policy runs/NAME` evaluates the driver.

    Run the same command again to continue after an interruption; the weights at the end are the same.
    """
    from scenarionet_data.storage.files.opening import open_files
    from scenarionet_sim.drivers.trained import load_driver
    from scenarionet_sim.learning.config import make_learner_config

    config = make_learner_config(algorithm, size, pairs(parameters, "-p"))
    try:
        from scenarionet_sim.learning.training import plan_training, run_training
    except ModuleNotFoundError as error:
        from scenarionet_data.errors import MissingDependency

        raise MissingDependency("learning needs torch", "learn") from error
    training = plan_training(
        lake, database, algorithm, config=config, seed=seed, tests=tests, observations=observations, name=name
    )
    run = name or f"{database or 'all'}-{algorithm}-seed{seed}".replace("@", ".").replace(":", ".")
    with ProgressDisplay(f"train {run}", "step", is_quiet=quiet) as progress:
        try:
            report = run_training(training, run, lambda row: progress.update(row["steps"], config.steps))
        except KeyboardInterrupt as error:
            raise Interrupted(f"checkpoints are kept in run {run}; run the same command again to continue") from error
    if onnx is not None:
        load_driver(open_files(lake), f"runs/{run}").export_onnx(onnx)
    _print(report, lake, as_json)


def _print(report: TrainingReport, lake: str, as_json: bool) -> None:
    query = f"SELECT steps, success, route_completion, cost FROM training WHERE run = '{report.run}' ORDER BY steps"
    join = f'scenarionet sql {lake} "{query}"'
    if as_json:
        print_json(vars(report) | {"speed": report.speed, "next": join})
        return
    if report.resumed:
        click.echo(f"continued  after {count(report.resumed, 'step')} of an earlier command")
    rows = {"training": report.last, **report.tests}
    names = ("success", "out_of_road", "timeout", "route_completion", "cost", "speed")
    if report.last:
        print_table([(title, *(row.get(key) for key in names)) for title, row in rows.items()], ("", *names))
        _print_times(report.times, report.speed)
        click.echo(f"memory     {size(report.memory)} of experience; disk: at most {size(report.disk)} of checkpoints")
    for scenario_id, reason in list(report.skipped.items())[:_MAX_EXAMPLES]:
        click.echo(f"left out: {scenario_id}: {one_line(reason)}", err=True)
    click.echo(f"run {report.run}: {count(report.steps, 'step')}, took {duration(report.seconds)}. Curve: {join}")


def _print_times(times: Mapping[str, Any], speed: float) -> None:
    total = sum(times.values()) or 1.0
    shares = ", ".join(f"{activity} {seconds / total:.0%}" for activity, seconds in times.items())
    click.echo(f"speed      {speed:,.0f} steps/s: {shares}")
