"""Closed-loop evaluation: a policy over every scenario of a database, in parallel, its results into the lake.

What a part's rows are depends on the part alone, not on who does it or when. A scenario that cannot be simulated is
a row with the reason; the run goes on.
"""

from __future__ import annotations

import time
from dataclasses import asdict, dataclass, field
from functools import cache
from typing import Any

import numpy as np
import pyarrow as pa

from scenarionet_data import Lake, ScenarioLoader, version
from scenarionet_data.errors import MissingDependency
from scenarionet_data.execution.executors import Executor
from scenarionet_data.execution.progress import Progress
from scenarionet_data.storage import evaluation_runs
from scenarionet_data.storage.files.opening import open_files
from scenarionet_sim.evaluation.drivers import Cast, cast, find_backend
from scenarionet_sim.evaluation.environment_cache import Theatre
from scenarionet_sim.evaluation.parts import Part, do_parts, parts_of
from scenarionet_sim.evaluation.rollout import roll_out
from scenarionet_sim.evaluation.rollout_table import rollout_rows, together
from scenarionet_sim.metrics.measure import measure
from scenarionet_sim.worlds.world import World

PART = 32
"""Scenarios of a part: what a worker that is killed loses at most."""

End = tuple[str, str | None, str | None]
"""Scenario id; how it ended; why it could not be simulated."""


@dataclass(frozen=True)
class Evaluation:
    """What is evaluated; picklable.

    Attributes:
        lake: The lake's folder.
        database: ``name@version``; None for the whole lake.
        snapshot: Number of the snapshot of the lake.
        policy: Who drives the ego: ``replay``, ``idm``, ``constant`` or ``module:Class``.
        traffic: Who drives the others: ``replay`` or ``idm``.
        backend: ``bullet`` or ``kinematic``: how an ego moves that is driven by actions.
        seed: Of the sensors' noise.
    """

    lake: str
    database: str | None
    snapshot: int
    policy: str
    traffic: str = "replay"
    backend: str = "bullet"
    seed: int = 0

    @property
    def description(self) -> dict[str, Any]:
        """All that the results depend on."""
        spec = {name: value for name, value in asdict(self).items() if name != "lake"}
        return spec | {"part": PART, "software": version.name_and_version()}


@dataclass
class Report:
    """What an evaluation did.

    Attributes:
        run: Its name.
        scenarios: Scenarios there are.
        skipped: Of these, those that an earlier command had done.
        broken: Scenario id and reason of those that could not be simulated, of this command's.
        seconds: Time it took.
    """

    run: str
    scenarios: int = 0
    skipped: int = 0
    broken: list[tuple[str, str]] = field(default_factory=list)
    seconds: float = 0.0


@dataclass(frozen=True)
class _Job:
    evaluation: Evaluation
    part: Part
    run: evaluation_runs.Run | None


def prepare(
    lake: Lake,
    database: str | None,
    policy: str,
    *,
    traffic: str = "replay",
    backend: str | None = None,
    seed: int = 0,
) -> Evaluation:
    """An evaluation of what a lake holds.

    Args:
        lake: At the snapshot to take.
        database: Its name, perhaps with a version; None for the whole lake.
        policy, traffic, seed: See :class:`Evaluation`.
        backend: The same; for None ``bullet`` where actions drive the ego, and ``kinematic`` where none is needed.

    Raises:
        DatabaseNotFound: There is none of that name.
        BadParameter: The name of a policy, traffic or backend is unknown.
    """
    is_driven = cast(policy, traffic).driver is not None
    moves = backend or ("bullet" if is_driven else "kinematic")
    find_backend(moves)
    reference = None if database is None else lake.database(database).reference
    return Evaluation(str(lake.root), reference, lake.snapshot.number, policy, traffic, moves, seed)


def evaluate(
    evaluation: Evaluation,
    name: str,
    *,
    workers: int = 1,
    executor: Executor | None = None,
    with_rollouts: bool = True,
    on_progress: Progress | None = None,
) -> Report:
    """Simulate what is not done yet, and write it into the lake.

    Args:
        evaluation: What.
        name: Of the run.
        workers: Processes.
        executor: Does the parts in place of the processes, for example a cluster.
        with_rollouts: Write what everybody did, not the metrics alone.
        on_progress: Told about every finished part.

    Raises:
        BadParameter: A run of that name is there and is another one.
        MissingDependency: A package that the backend needs is not installed.
        WorkerLost: A part kills its worker, also when it runs alone; finished parts are kept.
    """
    started = time.monotonic()
    written = ("rollouts", "results") if with_rollouts else ("results",)
    run = evaluation_runs.claim(open_files(evaluation.lake), name, written, evaluation.description)
    total, done = len(_scenarios(evaluation)), run.done()
    jobs = [_Job(evaluation, part, run) for part in parts_of(total, PART) if part.number not in done]
    report = Report(name, total, total - sum(len(job.part) for job in jobs))
    for ends in do_parts(jobs, simulate_part, workers, on_progress, executor, _lost_part):
        report.broken += [(scenario_id, error) for scenario_id, _, error in ends if error]
    report.seconds = time.monotonic() - started
    return report


def find_broken(
    lake: Lake,
    database: str | None = None,
    *,
    workers: int = 1,
    executor: Executor | None = None,
    on_progress: Progress | None = None,
) -> list[tuple[str, str]]:
    """Scenarios whose recording cannot be replayed to its destination, with the reason; nothing is written."""
    evaluation = prepare(lake, database, "replay")
    jobs = [_Job(evaluation, part, None) for part in parts_of(len(_scenarios(evaluation)), PART)]
    broken = []
    for ends in do_parts(jobs, simulate_part, workers, on_progress, executor, _lost_part):
        for scenario_id, end, error in ends:
            if end != "success":
                broken.append((scenario_id, error or f"the replayed recording ends with {end}"))
    return sorted(broken)


def _lost_part(job: _Job, reason: str) -> list[End]:
    """How a part's scenarios ended when no worker survived them; they have no rows, so the next command tries again."""
    ids = _scenarios(job.evaluation).scenario_ids[job.part.first : job.part.end]
    return [(scenario_id, None, reason) for scenario_id in ids]


@cache
def _scenarios(evaluation: Evaluation) -> ScenarioLoader:
    """Scenarios of an evaluation: looked up once a process."""
    return ScenarioLoader(Lake(evaluation.lake, evaluation.snapshot), evaluation.database)


# --- on a worker --------------------------------------------------------------------------------------


def simulate_part(job: _Job) -> list[End]:
    """Simulate a part's scenarios, and publish the rows if it belongs to a run."""
    evaluation, loader = job.evaluation, _scenarios(job.evaluation)
    who = cast(evaluation.policy, evaluation.traffic)
    results: list[dict[str, Any]] = []
    rollouts: list[pa.Table] = []
    with Theatre(who.policies, find_backend(evaluation.backend), getattr(who.driver, "sensors", None)) as theatre:
        for index in range(job.part.first, job.part.end):
            row, rollout = _simulated(loader, index, theatre, who, evaluation.seed)
            results.append(row)
            rollouts += [] if rollout is None else [rollout]
    if job.run is not None:
        job.run.publish(job.part.number, {"results": results, "rollouts": together(rollouts)})
    return [(row["scenario_id"], row.get("status"), row.get("error")) for row in results]


def _simulated(
    loader: ScenarioLoader, index: int, theatre: Theatre, who: Cast, seed: int
) -> tuple[dict[str, Any], pa.Table | None]:
    """A scenario's row of results, and its rows of rollouts."""
    scenario_id = loader.scenario_ids[index]
    try:
        world = World.from_scenario(loader[index])
        rollout = roll_out(theatre.arena(world), world, who.driver, np.random.default_rng([seed, index]))
        facts = {"scenario_id": scenario_id, "track_id": world.track_ids[rollout.agent]}
        return facts | measure(rollout, world), rollout_rows(rollout, world)
    except (MemoryError, MissingDependency):
        raise
    except Exception as error:  # whatever one scenario or a driver in it provokes, the others must go on
        theatre.clear()
        return {"scenario_id": scenario_id, "error": f"{type(error).__name__}: {error}"}, None
