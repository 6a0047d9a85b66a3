"""``scenarionet sim``: evaluate a driving policy on every scenario of a database."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import click

from scenarionet_pipelines.cli.advice import one_line
from scenarionet_pipelines.cli.execution import executor_from_options, worker_facts, worker_rows
from scenarionet_pipelines.cli.group import verb
from scenarionet_pipelines.cli.interrupt import Interrupted
from scenarionet_pipelines.cli.output import count, duration, print_json, print_table
from scenarionet_pipelines.cli.parameters import (
    cluster_option,
    json_option,
    lake_argument,
    look_in_current_folder,
    optional_database_argument,
    quiet_option,
    workers_option,
)
from scenarionet_pipelines.cli.progress import ProgressDisplay

if TYPE_CHECKING:
    from collections.abc import Mapping

    from scenarionet_data.execution.worker_stats import WorkerStats
    from scenarionet_sim.evaluation.evaluation import EvaluationReport

_MAX_EXAMPLES = 5


@verb(
    "sim",
    "scenarionet sim lake busy_val --policy idm",
    "scenarionet sim lake busy_val --policy my_planner:Planner --backend kinematic --traffic idm --workers 4",
    "scenarionet sim lake busy_val --policy idm --name idm_twice --json",
    "scenarionet sim lake busy_val --policy idm --cluster tcp://10.0.0.5:8786",
)
@lake_argument
@optional_database_argument
@click.option(
    "--policy", required=True, metavar="NAME", help="Policy of the ego: replay, idm, constant or module:Class."
)
@click.option(
    "--traffic",
    default="replay",
    show_default=True,
    metavar="NAME",
    help="Policy of the other vehicles: replay or idm.",
)
@click.option(
    "--backend",
    metavar="NAME",
    help="Vehicle dynamics: bullet or kinematic. [default: bullet if the policy returns actions]",
)
@click.option("--name", metavar="NAME", help="Name of the run. [default: DATABASE-POLICY-TRAFFIC-BACKEND]")
@workers_option
@cluster_option
@click.option("--seed", type=int, default=0, show_default=True, help="Seed of the sensor noise.")
@click.option("--metrics-only", is_flag=True, help="Do not write the trajectories of the run.")
@json_option
@quiet_option
def command(
    lake: str,
    database: str | None,
    policy: str,
    traffic: str,
    backend: str | None,
    name: str | None,
    workers: int | None,
    cluster: str | None,
    seed: int,
    metrics_only: bool,
    as_json: bool,
    quiet: bool,
) -> None:
    """Evaluate a policy on every scenario of a database, or of the whole lake.

    The view `results` has one row per scenario with every metric, the view `rollouts` the driven trajectories. Join
    them with metadata by scenario_id to find out where a planner fails.

    A policy of your own is module:Class: a class with a method act(observation) that returns steering and throttle
    in [-1, 1], or a subclass of scenarionet_sim.policies.Policy. It receives the paper's observation unless it has
    an attribute `sensors`.

    Finished scenarios are kept: run the same command again to continue after an interruption.
    """
    from scenarionet_pipelines.machine import default_workers
    from scenarionet_sim.evaluation.evaluation import plan_evaluation, run_evaluation

    look_in_current_folder(policy)
    evaluation = plan_evaluation(lake, database, policy, traffic=traffic, backend=backend, seed=seed)
    run = name or "-".join([database or "all", policy, traffic, evaluation.backend]).replace("@", ".").replace(":", ".")
    with (
        executor_from_options(cluster, workers, quiet=quiet) as execution,
        ProgressDisplay(f"sim {run}", "part", is_quiet=quiet) as progress,
    ):
        try:
            report = run_evaluation(
                evaluation,
                run,
                workers=workers or default_workers(),
                executor=execution.measured,
                rollouts=not metrics_only,
                on_progress=progress.update,
            )
        except KeyboardInterrupt as error:
            raise Interrupted(
                f"finished scenarios are kept in run {run}; run the same command again to continue"
            ) from error
    _print(report, lake, execution.stats, as_json)
    click.get_current_context().exit(1 if report.broken else 0)


def _print(report: EvaluationReport, lake: str, workers: Mapping[str, WorkerStats], as_json: bool) -> None:
    from scenarionet_data import Lake

    rows = Lake(lake).named_query("runs", {"run": report.run}).to_dicts()
    facts: dict[str, Any] = rows[0] if rows else {}
    join = f'scenarionet sql {lake} "SELECT * FROM results JOIN metadata USING (scenario_id) WHERE NOT success"'
    if as_json:
        broken = [{"scenario_id": scenario_id, "reason": reason} for scenario_id, reason in report.broken]
        done = {"run": report.run, "skipped": report.skipped, "seconds": report.seconds, "broken": broken}
        print_json(facts | done | {"scenarios": report.scenarios, "next": join} | worker_facts(workers))
        return
    if report.skipped:
        click.echo(f"skipped    {count(report.skipped, 'scenario')} finished by an earlier command")
    print_table([(key, value) for key, value in facts.items() if value is not None])
    print_table(worker_rows(workers, "part"))
    for scenario_id, reason in report.broken[:_MAX_EXAMPLES]:
        click.echo(f"could not be simulated: {scenario_id}: {one_line(reason)}", err=True)
    click.echo(f"took {duration(report.seconds)}. Failures: {join}")
