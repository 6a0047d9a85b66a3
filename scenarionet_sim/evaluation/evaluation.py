"""Closed-loop evaluation: drive a policy through every scenario of a database, in parallel, and store the results.

The rows of a part depend only on the part, not on the worker or on the order. A scenario that fails to simulate becomes
a row with its error; the run continues, and another call tries again the parts that have such rows.
"""

from __future__ import annotations

import hashlib
import time
from collections.abc import Callable, Iterator
from dataclasses import asdict, dataclass, field, replace
from functools import cache
from itertools import islice
from pathlib import Path
from typing import Any

import pyarrow as pa

from scenarionet_data import Database, Lake, ScenarioLoader, version
from scenarionet_data.arrays.dtypes import is_count
from scenarionet_data.errors import BadParameter
from scenarionet_data.execution.executors import Executor
from scenarionet_data.execution.progress import Progress
from scenarionet_data.storage import evaluation_runs
from scenarionet_data.storage.files.places import open_files
from scenarionet_sim.bridges.commonroad.by_name import environment_of, is_outside, versions_of
from scenarionet_sim.drivers.by_name import REACTIVE, Drivers, drives_alone, find_backend, is_model, resolve_drivers
from scenarionet_sim.drivers.code import PolicyCode, code_digest, pinned_code, policy_name
from scenarionet_sim.drivers.own_process import executor_of
from scenarionet_sim.drivers.requirements import made_interpreter
from scenarionet_sim.drivers.trained import PREFIX, pinned
from scenarionet_sim.metrics.drive import DrivenEpisode
from scenarionet_sim.metrics.measure import measure_all
from scenarionet_sim.rollouts.batch import SLOTS, RolloutBatch, RolloutJob
from scenarionet_sim.rollouts.loading import loaded_ahead
from scenarionet_sim.rollouts.parts import Part, parts_of, run_parts
from scenarionet_sim.rollouts.rollout import Rollout
from scenarionet_sim.rollouts.span import EPISODES
from scenarionet_sim.rollouts.table import concat_rollouts, rollout_rows
from scenarionet_sim.scenarios.selection import resolved

PART_SIZE = 32
"""Rollouts per part: the most work that a killed worker loses."""

_SCORED_TOGETHER = 8
"""Rollouts whose metrics are computed together."""

RULE = "to the end of the episode, off the road only where the recording is on it, progress along its lanes"
"""What metrics cover. Runs from before there was a choice of words say nothing: an ego of IDM that had reached the end
of its path was scored until then, and the road counted where the recording itself is off it. Runs that do not say
"along its lanes" measured progress along the recorded path."""

ScenarioEnd = tuple[str, str | None, str | None]
"""Scenario id, how the episode ended, and the error if it could not be simulated."""


@dataclass(frozen=True)
class Evaluation:
    """Specification of an evaluation; picklable.

    Attributes:
        lake: Path or URL of the lake.
        database: ``name@version``, scenario ids, or None for the whole lake.
        snapshot: Number of the lake's snapshot.
        policy: Driver of the ego: a name in ``DRIVERS``, ``random``, or ``module:Class``.
        traffic: Driver of all other objects: a name in ``TRAFFIC``, or ``model:RUN``.
        backend: Vehicle dynamics of an ego driven by actions: ``bullet`` or ``kinematic``.
        seed: Seed of stochastic policies and of the sensors' noise.
        rollouts: Number of rollouts of each scenario.
        episode: A name in ``EPISODES``.
        tracker: A name in ``TRACKERS``.
        route: A name in ``ROUTES``.
        python: Interpreter of the policy, in a process of its own; empty for this one.
        code: Digest of the modules of a policy in a process of its own, or versions of the packages it is in.
    """

    lake: str
    database: str | tuple[str, ...] | None
    snapshot: int
    policy: str
    traffic: str = "replay"
    backend: str = "kinematic"
    seed: int = 0
    rollouts: int = 1
    episode: str = "log"
    tracker: str = "lqr"
    route: str = "log"
    python: str = ""
    code: str = ""

    @property
    def description(self) -> dict[str, Any]:
        """Everything the results depend on, as stored with the run."""
        spec = {name: value for name, value in asdict(self).items() if name != "lake"}
        spec["database"] = describe_database(self.database)
        for name in ("tracker", "route", "python", "code"):  # as in runs from before there was a choice
            if spec[name] == getattr(type(self), name):
                del spec[name]
        return spec | {"rule": RULE, "part": PART_SIZE, "software": version.name_and_version()}

    @property
    def default_name(self) -> str:
        """Name of the run unless one is given: database, policy, traffic and backend, and the episode if not all."""
        words = [describe_database(self.database) or "all", policy_name(self.policy), self.traffic, self.backend]
        words += [value for value in (self.episode, self.route) if value != "log"]
        name = "-".join(words if self.tracker == "lqr" else [*words, self.tracker])
        return name.replace("@", ".").replace(":", ".").replace("/", ".")

    def drivers(self) -> Drivers:
        """Return the drivers of ego and traffic; raises if one is unknown."""
        return resolve_drivers(self.policy, self.traffic, self.backend, self.tracker, self.route, self.lake)


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


@dataclass(frozen=True)
class EvaluationJob:
    """A part of an evaluation.

    Attributes:
        evaluation: The evaluation.
        part: Which rollouts.
        run: What the part belongs to; None to store nothing.
        has_trajectories: Whether the trajectories are wanted, too, and not only the metrics.
    """

    evaluation: Evaluation
    part: Part
    run: evaluation_runs.EvaluationRun | None
    has_trajectories: bool = True


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
    parts = parts_of(total * evaluation.rollouts, PART_SIZE)
    jobs = [EvaluationJob(evaluation, part, run, rollouts) for part in parts if part.number not in done]
    left = {item // evaluation.rollouts for job in jobs for item in range(job.part.first, job.part.end)}
    report = EvaluationReport(name, total, total - len(left))
    broken: dict[str, str] = {}
    executor = executor_of(evaluation.policy, evaluation.python, workers, executor) if jobs else executor
    for ends in run_parts(jobs, simulate_part, workers, on_progress, executor, _ends_of_lost_part):
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
    parts = parts_of(len(scenarios_of(evaluation)), PART_SIZE)
    jobs = [EvaluationJob(evaluation, part, None, has_trajectories=False) for part in parts]
    broken = []
    for ends in run_parts(jobs, simulate_part, workers, on_progress, executor, _ends_of_lost_part):
        for scenario_id, end, error in ends:
            if end != "success":
                broken.append((scenario_id, error or f"the replayed recording ends with {end}"))
    return sorted(broken)


def describe_database(database: str | tuple[str, ...] | None) -> str | None:
    """Return a reference unchanged, and a list of ids as its length and digest."""
    if not isinstance(database, tuple):
        return database
    digest = hashlib.sha256("\n".join(database).encode()).hexdigest()[:12]
    return f"{len(database)}-scenarios-{digest}"


def _ends_of_lost_part(job: EvaluationJob, reason: str) -> list[ScenarioEnd]:
    """Ends of a part that killed its worker; it has no rows, so the next run tries it again."""
    ids = scenarios_of(job.evaluation).scenario_ids
    numbers = (item // job.evaluation.rollouts for item in range(job.part.first, job.part.end))
    return [(ids[number], None, reason) for number in numbers]


@cache
def scenarios_of(evaluation: Evaluation) -> ScenarioLoader:
    """Return the scenarios of an evaluation, resolved once per process."""
    return ScenarioLoader(Lake(evaluation.lake, evaluation.snapshot), evaluation.database)


# --- on a worker --------------------------------------------------------------------------------------


def imported_code(evaluation: Evaluation) -> str:
    """Import the policy, in its process; return a digest of the modules that it has imported from its folder.

    Of planners of other packages, return the versions of those.
    """
    evaluation.drivers()
    if is_outside(evaluation.policy):
        return versions_of(evaluation.policy)
    code = PolicyCode.of(evaluation.policy)
    return code_digest(Path.cwd() if code is None else code.root)


def simulate_part(job: EvaluationJob) -> list[ScenarioEnd]:
    """Simulate the rollouts of a part, and publish the rows if it belongs to a run."""
    rows, rollouts = simulate(job)
    if job.run is not None:
        job.run.publish(job.part.number, {"results": rows, "rollouts": rollouts})
    return [(row["scenario_id"], row.get("status"), row.get("error")) for row in rows]


def simulate(job: EvaluationJob) -> tuple[list[dict[str, Any]], pa.Table]:
    """Return the rows of ``results`` and ``rollouts`` of a part, without the column run; no rollouts if not wanted."""
    evaluation = job.evaluation
    drivers = evaluation.drivers()
    # Bullet's worlds differ in their last digits by what else is in its memory; a person or a stack drives one world.
    is_single = evaluation.backend == "bullet" or drives_alone(evaluation.policy)
    batch = RolloutBatch(drivers, find_backend(evaluation.backend), 1 if is_single else SLOTS)
    is_reactive = evaluation.traffic in REACTIVE or is_model(evaluation.traffic)
    results: dict[int, dict[str, Any]] = {}
    trajectories: dict[int, pa.Table] = {}

    def fail(item: int, error: Exception) -> None:
        results[item] = _key(job, item) | {"error": f"{type(error).__name__}: {error}"}

    played = batch.run(_rollout_jobs(job, fail))
    while some := list(islice(played, _SCORED_TOGETHER)):
        driven = [(each.number, each.world, rollout) for each, rollout in some if isinstance(rollout, Rollout)]
        rows = measure_all([DrivenEpisode(rollout, world) for _, world, rollout in driven])
        for each, error in some:
            if isinstance(error, Exception):
                fail(each.number, error)
        for (item, world, rollout), row in zip(driven, rows, strict=True):
            if isinstance(row, Exception):
                fail(item, row)
                continue
            of_agent = {"track_id": world.track_ids[rollout.agent], "is_reactive": is_reactive}
            results[item] = _key(job, item) | of_agent | row
            if job.has_trajectories:
                trajectories[item] = rollout_rows(rollout, world, item % evaluation.rollouts)
    rollouts = concat_rollouts([trajectories[item] for item in sorted(trajectories)])
    return [results[item] for item in sorted(results)], rollouts


def _key(job: EvaluationJob, item: int) -> dict[str, Any]:
    index, number = divmod(item, job.evaluation.rollouts)
    return {"scenario_id": scenarios_of(job.evaluation).scenario_ids[index], "rollout": number}


def _rollout_jobs(job: EvaluationJob, fail: Callable[[int, Exception], None]) -> Iterator[RolloutJob]:
    """Yield the rollouts of a part; report those whose scenario cannot be loaded."""
    evaluation, span = job.evaluation, EPISODES[job.evaluation.episode]
    first, last = job.part.first // evaluation.rollouts, (job.part.end - 1) // evaluation.rollouts
    for index, loaded in loaded_ahead(scenarios_of(evaluation), range(first, last + 1), span):
        begin = index * evaluation.rollouts
        items = range(max(begin, job.part.first), min(begin + evaluation.rollouts, job.part.end))
        if isinstance(loaded, Exception):
            for item in items:
                fail(item, loaded)
            continue
        world, start = loaded
        num_steps = span.num_steps(world, start)
        for item in items:
            yield RolloutJob(item, world, (evaluation.seed, index, item - begin), start, num_steps, span.waits)
