"""``scenarionet runs record``: record the observations of vehicles for imitation learning."""

from __future__ import annotations

import time

import click

from scenarionet_pipelines.cli.execution import executor_from_options
from scenarionet_pipelines.cli.group import verb
from scenarionet_pipelines.cli.interrupt import Interrupted
from scenarionet_pipelines.cli.output import count, duration, print_json
from scenarionet_pipelines.cli.parameters import (
    cluster_option,
    json_option,
    lake_argument,
    optional_database_argument,
    quiet_option,
    workers_option,
)
from scenarionet_pipelines.cli.progress import ProgressDisplay


def _size(_context: click.Context, _parameter: click.Parameter, value: str | None) -> tuple[int, int] | None:
    if value is None:
        return None
    width, _, height = value.partition("x")
    if not (width.isdecimal() and height.isdecimal()):
        raise click.BadParameter(f"expected WIDTHxHEIGHT [pixels], for example 320x180, found {value!r}")
    return int(width), int(height)


@verb(
    "record",
    "scenarionet runs record lake busy_train",
    "scenarionet runs record lake busy_train --agents ego --name ego_states",
)
@lake_argument
@optional_database_argument
@click.option(
    "--agents", default="vehicles", metavar="NAME", show_default=True, help="Agents that observe: vehicles or ego."
)
@click.option(
    "--camera", metavar="WIDTHxHEIGHT", callback=_size, help="Record what a camera on every agent sees, too, in colour."
)
@click.option("--name", metavar="NAME", help="Name of the run. [default: DATABASE-AGENTS-observed]")
@workers_option
@cluster_option
@click.option("--seed", type=int, default=0, show_default=True, help="Seed of the sensor noise.")
@json_option
@quiet_option
def command(
    lake: str,
    database: str | None,
    agents: str,
    camera: tuple[int, int] | None,
    name: str | None,
    workers: int | None,
    cluster: str | None,
    seed: int,
    as_json: bool,
    quiet: bool,
) -> None:
    """Record what every vehicle observes along its logged trajectory, for imitation learning.

    The view `observations` has one row per vehicle and timestep, with the paper's observation as a list. The rows are
    states without actions, the paper's dataset for multi-agent imitation. With --camera, the view `frames` has one row
    per vehicle and timestep with its picture.

    Finished scenarios are kept: run the same command again to continue after an interruption.
    """
    from scenarionet_data import Lake
    from scenarionet_pipelines.machine import default_workers
    from scenarionet_sim import record
    from scenarionet_sim.sensors.camera import Camera

    run = name or f"{database or 'all'}-{agents}-observed".replace("@", ".")
    started = time.monotonic()
    with (
        executor_from_options(cluster, workers, quiet=quiet) as execution,
        ProgressDisplay(f"record {run}", "part", is_quiet=quiet) as progress,
    ):
        try:
            skipped = record(
                lake,
                database,
                name=run,
                agents=agents,
                seed=seed,
                cameras=(Camera(*camera),) if camera else (),
                workers=workers or default_workers(),
                executor=execution.executor,
                on_progress=progress.update,
            )
        except KeyboardInterrupt as error:
            raise Interrupted(
                f"finished scenarios are kept in run {run}; run the same command again to continue"
            ) from error
    query = "SELECT count(*), count(DISTINCT scenario_id) FROM observations WHERE run = $run"
    rows, scenarios = Lake(lake).sql(query, {"run": run}).row(0)
    took = time.monotonic() - started
    if as_json:
        print_json({"run": run, "scenarios": scenarios, "skipped": skipped, "observations": rows, "seconds": took})
    else:
        click.echo(f"{run}: {count(rows, 'observation')} of {count(scenarios, 'scenario')}, took {duration(took)}")
        click.echo(f"Query them: scenarionet sql {lake} \"SELECT * FROM observations WHERE run = '{run}' LIMIT 3\"")
