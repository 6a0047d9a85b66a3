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
    from scenarionet_sim.evaluation.evaluation import Evaluation, EvaluationReport

_MAX_EXAMPLES = 5


@verb(
    "sim",
    "scenarionet sim lake busy_val --policy idm",
    "scenarionet sim lake busy_val --policy my_planner:Planner --backend kinematic --traffic idm --workers 4",
    "scenarionet sim lake busy_val --policy runs/busy_train-ppo-seed0 --workers 4",
    "scenarionet sim lake busy_val --policy idm --name idm_twice --json",
    "scenarionet sim lake busy_val --policy idm-sampled --traffic idm-sampled --rollouts 32 --seed 0",
    "scenarionet sim lake busy_val --policy idm --cluster tcp://10.0.0.5:8786",
)
@lake_argument
@optional_database_argument
@click.option(
    "--policy",
    required=True,
    metavar="NAME",
    help="Policy of the ego: replay, idm, idm-sampled, constant, constant-noisy, random, a planner (log-planner, "
    "constant-planner, pure-pursuit, idm-planner, lane-graph), runs/NAME of a training run, or module:Class.",
)
@click.option(
    "--traffic",
    default="replay",
    show_default=True,
    metavar="NAME",
    help="Policy of the others: replay, idm, idm-sampled, idm-walking (where pedestrians and cyclists react, too), "
    "constant or constant-noisy.",
)
@click.option(
    "--backend",
    metavar="NAME",
    help="Vehicle dynamics: bullet or kinematic. [default: bullet if the policy returns actions]",
)
@click.option("--name", metavar="NAME", help="Name of the run. [default: DATABASE-POLICY-TRAFFIC-BACKEND]")
@workers_option
@cluster_option
@click.option(
    "--rollouts",
    "num_rollouts",
    type=click.IntRange(min=1),
    default=1,
    show_default=True,
    metavar="N",
    help="Rollouts of each scenario, which differ if a policy is stochastic.",
)
@click.option(
    "--seed", type=int, default=0, show_default=True, help="Seed of stochastic policies and of the sensor noise."
)
@click.option(
    "--episode",
    type=click.Choice(["log", "nuplan", "wosac"]),
    default="log",
    show_default=True,
    help="What to drive: the whole recording, 15 s of it, or 8 s after the history.",
)
@click.option(
    "--tracker",
    type=click.Choice(["lqr", "perfect"]),
    default="lqr",
    show_default=True,
    help="What follows the trajectories of a planner: nuPlan's LQR with a bicycle, or exactly.",
)
@click.option(
    "--route",
    type=click.Choice(["log", "lanes"]),
    default="log",
    show_default=True,
    help="Route of the ego: its recorded path, or the way along the lanes to the end of it.",
)
@click.option("--metrics-only", is_flag=True, help="Do not write the trajectories of the run.")
@click.option(
    "--no-references", is_flag=True, help="Do not simulate the recording, constant velocity and random actions."
)
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
    num_rollouts: int,
    seed: int,
    episode: str,
    tracker: str,
    route: str,
    metrics_only: bool,
    no_references: bool,
    as_json: bool,
    quiet: bool,
) -> None:
    """Evaluate a policy on every scenario of a database, or of the whole lake.

    The view `results` has one row per scenario and rollout with every metric, the view `rollouts` the driven
    trajectories. Join them with metadata by scenario_id to find out where a planner fails.

    Beside the results stand those of the recording itself, a ceiling, and of constant velocity and random actions, the
    floors, on the same scenarios. They are runs, too, and simulated once.

    A policy of your own is module:Class: a subclass of scenarionet_sim.Planner, whose method act(view) returns an
    action or a trajectory; a class with a method act(observation) that returns steering and throttle in [-1, 1] for
    the paper's observation, or that of its attribute `sensors`; or a subclass of scenarionet_sim.Policy.

    Finished scenarios are kept: run the same command again to continue after an interruption.
    """
    from scenarionet_pipelines.machine import default_workers
    from scenarionet_sim.drivers.by_name import MANUAL
    from scenarionet_sim.evaluation.evaluation import plan_evaluation, run_evaluation
    from scenarionet_sim.evaluation.references import run_references

    look_in_current_folder(policy)
    evaluation = plan_evaluation(
        lake,
        database,
        policy,
        traffic=traffic,
        backend=backend,
        seed=seed,
        num_rollouts=num_rollouts,
        episode=episode,
        tracker=tracker,
        route=route,
    )
    run = name or _default_name(evaluation, database)
    workers = 1 if policy in MANUAL else workers
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
            references = (
                {}
                if no_references
                else run_references(evaluation, workers=workers or default_workers(), executor=execution.executor)
            )
        except KeyboardInterrupt as error:
            raise Interrupted(
                f"finished scenarios are kept in run {run}; run the same command again to continue"
            ) from error
    _print(report, references, lake, execution.stats, as_json)
    click.get_current_context().exit(1 if report.broken else 0)


def _default_name(evaluation: Evaluation, database: str | None) -> str:
    """Name of the run, by the database as it was given, without its version."""
    words = [database or "all", evaluation.policy, evaluation.traffic, evaluation.backend]
    words += [value for value in (evaluation.episode, evaluation.route) if value != "log"]
    words += [] if evaluation.tracker == "lqr" else [evaluation.tracker]
    return "-".join(words).replace("@", ".").replace(":", ".").replace("/", ".")


def _print(
    report: EvaluationReport,
    references: Mapping[str, str],
    lake: str,
    workers: Mapping[str, WorkerStats],
    as_json: bool,
) -> None:
    facts = _facts(lake, report.run)
    beside = {title: _facts(lake, run) for title, run in references.items()}
    failures = f"results JOIN metadata USING (scenario_id) WHERE run = '{report.run}' AND success IS NOT TRUE"
    join = f'scenarionet sql {lake} "SELECT * FROM {failures}"'
    if as_json:
        broken = [{"scenario_id": scenario_id, "reason": reason} for scenario_id, reason in report.broken]
        done = {"run": report.run, "skipped": report.skipped, "seconds": report.seconds, "broken": broken}
        counts = {"scenarios": report.scenarios, "references": beside, "next": join}
        print_json(facts | done | counts | worker_facts(workers))
        return
    if report.skipped:
        click.echo(f"skipped    {count(report.skipped, 'scenario')} finished by an earlier command")
    rows = [
        (key, value, *(each.get(key) for each in beside.values())) for key, value in facts.items() if value is not None
    ]
    print_table(rows[1:], ("", "this run", *beside))
    print_table(worker_rows(workers, "part"))
    for scenario_id, reason in report.broken[:_MAX_EXAMPLES]:
        click.echo(f"could not be simulated: {scenario_id}: {one_line(reason)}", err=True)
    click.echo(f"run {report.run}, took {duration(report.seconds)}. Failures: {join}")


def _facts(lake: str, run: str) -> dict[str, Any]:
    """Summary of a run; empty without rows."""
    from scenarionet_data import Lake

    rows = Lake(lake).named_query("runs", {"run": run}).to_dicts()
    return rows[0] if rows else {}
