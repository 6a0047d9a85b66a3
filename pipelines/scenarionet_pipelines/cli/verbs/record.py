"""``scenarionet record``: what vehicles observe along their recordings, for imitation."""

from __future__ import annotations

import time

import click

from scenarionet_pipelines.cli.execution import executor_from_options
from scenarionet_pipelines.cli.group import verb
from scenarionet_pipelines.cli.interrupt import Interrupted
from scenarionet_pipelines.cli.output import count, duration, print_json
from scenarionet_pipelines.cli.parameters import cluster_option, json_option, lake_argument, quiet_option
from scenarionet_pipelines.cli.progress import ProgressDisplay


@verb("record", "scenarionet record lake busy_train", "scenarionet record lake busy_train --agents ego --to ego_states")
@lake_argument
@click.argument("database", metavar="DB", required=False)
@click.option("--agents", default="vehicles", metavar="NAME", help="Who observes: vehicles (default), or ego.")
@click.option("--to", "name", metavar="RUN", help="Name of the run; DB-AGENTS-observed unless given.")
@click.option("--workers", type=click.IntRange(1), help="Processes; one a core unless given.")
@cluster_option
@click.option("--seed", type=int, default=0, help="Of the sensors' noise.")
@json_option
@quiet_option
def command(
    lake: str,
    database: str | None,
    agents: str,
    name: str | None,
    workers: int | None,
    cluster: str | None,
    seed: int,
    as_json: bool,
    quiet: bool,
) -> None:
    """Write each vehicle's observations along the log of a database, or of the whole lake.

    They stand in the view `observations`: a row a vehicle and timestep, with the paper's observation as one list.
    They are states without actions, the paper's dataset for imitation with many agents.

    What is done once is kept: run the same command after an interruption and it goes on from there.
    """
    from scenarionet_data import Lake
    from scenarionet_pipelines.machine import default_workers
    from scenarionet_sim import record

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
                workers=workers or default_workers(),
                executor=execution.executor,
                on_progress=progress.update,
            )
        except KeyboardInterrupt as error:
            raise Interrupted(f"what is finished is kept in run {run}; the same command goes on from there") from error
    query = "SELECT count(*), count(DISTINCT scenario_id) FROM observations WHERE run = $run"
    rows, scenarios = Lake(lake).sql(query, {"run": run}).row(0)
    took = time.monotonic() - started
    if as_json:
        print_json({"run": run, "scenarios": scenarios, "skipped": skipped, "observations": rows, "seconds": took})
    else:
        click.echo(f"{run}: {count(rows, 'observation')} of {count(scenarios, 'scenario')}, took {duration(took)}")
        click.echo(f"Read them: scenarionet sql {lake} \"SELECT * FROM observations WHERE run = '{run}' LIMIT 3\"")
