"""``scenarionet sim``: a policy drives every scenario of a database; how it went is in the lake."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import click

from scenarionet_pipelines.cli.execution import executor_from_options, worker_facts, worker_rows
from scenarionet_pipelines.cli.group import one_line, verb
from scenarionet_pipelines.cli.interrupt import Interrupted
from scenarionet_pipelines.cli.output import count, duration, print_json, print_table
from scenarionet_pipelines.cli.parameters import (
    cluster_option,
    json_option,
    lake_argument,
    look_in_current_folder,
    quiet_option,
)
from scenarionet_pipelines.cli.progress import ProgressDisplay

if TYPE_CHECKING:
    from collections.abc import Mapping

    from scenarionet_data.execution.worker_stats import WorkerStats
    from scenarionet_sim.evaluation.evaluation import EvaluationReport

_NUM_EXAMPLES = 5


@verb(
    "sim",
    "scenarionet sim lake busy_val --policy idm",
    "scenarionet sim lake busy_val --policy my_planner:Planner --backend kinematic --traffic idm --workers 4",
    "scenarionet sim lake busy_val --policy idm --to idm_twice --json",
    "scenarionet sim lake busy_val --policy idm --cluster tcp://10.0.0.5:8786",
)
@lake_argument
@click.argument("database", metavar="DB", required=False)
@click.option(
    "--policy", required=True, metavar="NAME", help="Who drives the ego: replay, idm, constant, module:Class."
)
@click.option("--traffic", default="replay", metavar="NAME", help="Who drives the others: replay (default) or idm.")
@click.option(
    "--backend", metavar="NAME", help="Physics of what actions drive: bullet (default where they do) or kinematic."
)
@click.option("--to", "name", metavar="RUN", help="Name of the run; DB-POLICY-TRAFFIC-BACKEND unless given.")
@click.option("--workers", type=click.IntRange(1), help="Processes; one a core unless given.")
@cluster_option
@click.option("--seed", type=int, default=0, help="Of the sensors' noise.")
@click.option("--metrics-only", is_flag=True, help="Do not write what everybody did.")
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
    """Let a policy drive every scenario of a database, or of the whole lake.

    How each scenario went stands in the view `results`, a row a scenario with every metric; what everybody did in
    `rollouts`. Both are keyed by scenario_id: where a planner fails is one join with metadata away.

    A policy of your own is module:Class. Either it has a method act(observation) that returns steering and
    throttle in [-1, 1] (what it observes is the paper's observation, or its attribute `sensors`), or it is a
    subclass of scenarionet_sim.policies.Policy.

    What is done once is kept: run the same command after an interruption and it goes on from there.
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
            raise Interrupted(f"what is finished is kept in run {run}; the same command goes on from there") from error
    _print(report, lake, execution.stats, as_json)
    click.get_current_context().exit(1 if report.broken else 0)


def _print(report: EvaluationReport, lake: str, shares: Mapping[str, WorkerStats], as_json: bool) -> None:
    from scenarionet_data import Lake

    rows = Lake(lake).named_query("runs", {"run": report.run}).to_dicts()
    facts: dict[str, Any] = rows[0] if rows else {}
    join = f'scenarionet sql {lake} "SELECT * FROM results JOIN metadata USING (scenario_id) WHERE NOT success"'
    if as_json:
        broken = [{"scenario_id": scenario_id, "reason": reason} for scenario_id, reason in report.broken]
        done = {"run": report.run, "skipped": report.skipped, "seconds": report.seconds, "broken": broken}
        print_json(facts | done | {"scenarios": report.scenarios, "next": join} | worker_facts(shares))
        return
    if report.skipped:
        click.echo(f"skipped    {count(report.skipped, 'scenario')} that an earlier command had done")
    print_table([(key, value) for key, value in facts.items() if value is not None])
    print_table(worker_rows(shares, "part"))
    for scenario_id, reason in report.broken[:_NUM_EXAMPLES]:
        click.echo(f"could not be simulated: {scenario_id}: {one_line(reason)}", err=True)
    click.echo(f"took {duration(report.seconds)}. Where it fails: {join}")
