"""Closed-loop evaluation: drive a policy through every scenario of a database, in parallel, and store the results.

The rows of a part depend only on the part, not on the worker or on the order. A scenario that fails to simulate becomes
a row with its error; the run continues, and another call tries again the parts that have such rows.
"""

from __future__ import annotations

import time
from dataclasses import dataclass, field, replace
from pathlib import Path

from scenarionet_data import Database, Lake
from scenarionet_data.arrays.dtypes import is_count
from scenarionet_data.errors import BadParameter
from scenarionet_data.execution.executors import Executor
from scenarionet_data.execution.progress import Progress
from scenarionet_data.storage import evaluation_runs
from scenarionet_data.storage.files.places import open_files
from scenarionet_sim.bridges.commonroad.by_name import environment_of
from scenarionet_sim.drivers.code import pinned_code
from scenarionet_sim.drivers.own_process import executor_of
from scenarionet_sim.drivers.requirements import made_interpreter
from scenarionet_sim.drivers.trained import PREFIX, pinned
from scenarionet_sim.evaluation.parts import EvaluationJob, ends_of_lost_part, imported_code, simulate_part
from scenarionet_sim.evaluation.specification import Evaluation, scenarios_of
from scenarionet_sim.rollouts.parts import parts_of, run_parts
from scenarionet_sim.rollouts.span import EPISODES
from scenarionet_sim.scenarios.selection import resolved

_SHOWN = 10
"""Broken scenarios listed in a notebook."""


@dataclass
class EvaluationReport:
    """Result of an evaluation.

    Attributes:
        run: Name of the run.
        scenarios: Number of scenarios.
        skipped: Scenarios that an earlier call had already simulated, in all their rollouts.
        broken: Scenario id and error of those that failed to simulate in this call.
        seconds: Wall time of this call.
    """

    run: str
    scenarios: int = 0
    skipped: int = 0
    broken: list[tuple[str, str]] = field(default_factory=list)
    seconds: float = 0.0

    def __repr__(self) -> str:
        done = f"{self.scenarios} scenarios, {self.skipped} already done, {len(self.broken)} broken"
        return f"EvaluationReport({self.run!r}: {done}, {self.seconds:.1f} s)"

    def _repr_html_(self) -> str:
        from scenarionet_data.display import properties_card  # notebooks only

        properties = {
            "run": self.run,
            "scenarios": f"{self.scenarios:,}, {self.skipped:,} of them simulated earlier",
            "broken": f"{len(self.broken):,}",
            "time": f"{self.seconds:.1f} s",
        }
        return properties_card(properties, self.broken[:_SHOWN], ("scenario_id", "error"))


def evaluate(
    lake: Lake | str | Path,
    database: Database | str | list[str] | tuple[str, ...] | None = None,
    *,
    policy: str,
    name: str | None = None,
    traffic: str = "replay",
    backend: str = "kinematic",
    seed: int = 0,
    num_rollouts: int = 1,
    episode: str = "log",
    tracker: str = "lqr",
    route: str = "log",
    python: str = "",
    workers: int = 1,
    executor: Executor | None = None,
    rollouts: bool = True,
    on_progress: Progress | None = None,
) -> EvaluationReport:
    """Drive a policy through every scenario of a database and write the results into the lake.

    A second call with the same arguments continues an interrupted run, from the snapshot that it began with, and tries
    again what could not be simulated.

    Args:
        lake: The lake, its path or its URL.
        database: A ``Database``, its name, scenario ids, or None for the whole lake.
        policy: Driver of the ego: a name in ``drivers.by_name.DRIVERS`` or ``PLANNERS``, ``random``,
            ``runs/NAME`` of a training run, or one of your own: ``module:Class``, or in a process of its own
            ``folder/file.py:Class`` or ``git:REF:module:Class``.
        name: Name of the run; None for database, policy, traffic and backend joined by hyphens.
        traffic: Driver of all other objects: a name in ``drivers.by_name.TRAFFIC``.
        backend: ``kinematic`` or ``bullet``, for an ego driven by actions.
        seed: Seed of stochastic policies and of the sensors' noise.
        num_rollouts: Rollouts of each scenario.
        episode: ``log`` (the whole recording), ``nuplan`` (15 s) or ``wosac`` (8 s after the history).
        tracker: ``lqr`` or ``perfect``: what follows the trajectories of a planner.
        route: ``log`` (the recorded path) or ``lanes`` (along the lanes to its end).
        python: Interpreter of another environment, which has this version of this software, for the policy, or a
            requirements file (``.txt``), of which an environment is made once; of
            planners of CommonRoad, it is that of the variable SCENARIONET_PLANNERS unless given.
        workers: Number of processes.
        executor: Runs the parts instead of local processes, for example on a cluster.
        rollouts: Also write the trajectories of all objects, not only the metrics.
        on_progress: Called after each finished part.

    Raises:
        DatabaseNotFound: The database does not exist.
        BadParameter: A policy, traffic, backend or episode is unknown, the number of rollouts is not positive, or a
            run of that name has other parameters.
        SourceNotFound: There is no such commit, file or requirements file.
        MissingDependency: The backend needs a package that is not installed.
        WorkerLost: A part kills its worker also when it runs alone; finished parts are kept.
    """
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
        python=python,
    )
    return run_evaluation(
        evaluation, name, workers=workers, executor=executor, rollouts=rollouts, on_progress=on_progress
    )


def plan_evaluation(
    lake: Lake | str | Path,
    database: Database | str | list[str] | tuple[str, ...] | None,
    policy: str,
    *,
    traffic: str = "replay",
    backend: str = "kinematic",
    seed: int = 0,
    num_rollouts: int = 1,
    episode: str = "log",
    tracker: str = "lqr",
    route: str = "log",
    python: str = "",
) -> Evaluation:
    """Return the specification of an evaluation; arguments and errors as in :func:`evaluate`."""
    if not isinstance(policy, str):
        raise BadParameter(f"policy={policy!r}; expected a name such as 'idm', or 'module:Class' of one of your own")
    if not is_count(seed):
        raise BadParameter(f"seed={seed!r}; expected a whole number of 0 or more")
    if not is_count(num_rollouts, 1):
        raise BadParameter(f"{num_rollouts!r} rollouts of each scenario; expected at least 1")
    if episode not in EPISODES:
        raise BadParameter(f"unknown episode {episode!r}; choose from {', '.join(EPISODES)}")
    lake, reference = resolved(lake, database)
    if policy.startswith(PREFIX):
        policy = pinned(lake.files, policy)
    policy, python, number = pinned_code(policy), environment_of(policy, made_interpreter(python)), lake.snapshot.number
    evaluation = Evaluation(
        str(lake.root), reference, number, policy, traffic, backend, seed, num_rollouts, episode, tracker, route, python
    )
    executor = executor_of(policy, python, 1)
    if executor is None:
        evaluation.drivers()  # raises if one is unknown
        return evaluation
    (code,) = executor([evaluation], imported_code)
    return replace(evaluation, code=code)


def run_evaluation(
    evaluation: Evaluation,
    name: str | None = None,
    *,
    workers: int = 1,
    executor: Executor | None = None,
    rollouts: bool = True,
    on_progress: Progress | None = None,
) -> EvaluationReport:
    """Simulate the parts that are not done yet; arguments and errors as in :func:`evaluate`."""
    started, name = time.monotonic(), name or evaluation.default_name
    if evaluation.database is not None:  # its scenarios are fixed: go on where the run began, though the lake has grown
        begun = evaluation_runs.begun_at(open_files(evaluation.lake), name)
        evaluation = evaluation if begun is None else replace(evaluation, snapshot=begun)
    tables = ("rollouts", "results") if rollouts else ("results",)
    run = evaluation_runs.claim(open_files(evaluation.lake), name, tables, evaluation.description)
    total, done = len(scenarios_of(evaluation)), run.done() - run.failed()
    parts = parts_of(total * evaluation.rollouts, evaluation.part_size)
    jobs = [EvaluationJob(evaluation, part, run, rollouts) for part in parts if part.number not in done]
    left = {item // evaluation.rollouts for job in jobs for item in range(job.part.first, job.part.end)}
    report = EvaluationReport(name, total, total - len(left))
    broken: dict[str, str] = {}
    executor = executor_of(evaluation.policy, evaluation.python, workers, executor) if jobs else executor
    for ends in run_parts(jobs, simulate_part, workers, on_progress, executor, ends_of_lost_part):
        broken |= {scenario_id: error for scenario_id, _, error in ends if error}
    report.broken = list(broken.items())
    report.seconds = time.monotonic() - started
    return report


def find_broken(
    lake: Lake | str | Path,
    database: Database | str | list[str] | tuple[str, ...] | None = None,
    *,
    workers: int = 1,
    executor: Executor | None = None,
    on_progress: Progress | None = None,
) -> list[tuple[str, str]]:
    """Return the scenarios whose replay does not reach the destination, with the reason; writes nothing."""
    evaluation = plan_evaluation(lake, database, "replay")
    parts = parts_of(len(scenarios_of(evaluation)), evaluation.part_size)
    jobs = [EvaluationJob(evaluation, part, None, has_trajectories=False) for part in parts]
    broken = []
    for ends in run_parts(jobs, simulate_part, workers, on_progress, executor, ends_of_lost_part):
        for scenario_id, end, error in ends:
            if end != "success":
                broken.append((scenario_id, error or f"the replayed recording ends with {end}"))
    return sorted(broken)
