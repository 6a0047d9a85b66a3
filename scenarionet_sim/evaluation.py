"""Closed-loop evaluation: a policy over every scenario of a database, in parallel, its results into the lake.

The work comes in parts of PART scenarios; what a part's rows are depends on the part alone, not on who does it.
A scenario that cannot be simulated is a row with the reason; the run goes on.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from dataclasses import asdict, dataclass, field
from functools import cache
from typing import Any

import numpy as np
import pyarrow as pa

from scenarionet_data import Lake, ScenarioLoader, software
from scenarionet_data.errors import MissingDependency
from scenarionet_data.jobs import run_pool
from scenarionet_data.store import runs
from scenarionet_data.store.files import LakeFiles
from scenarionet_sim.drivers import Cast, cast, find_backend
from scenarionet_sim.metrics.measure import measure
from scenarionet_sim.rollout import roll_out
from scenarionet_sim.rollout_table import rollout_rows, together
from scenarionet_sim.theatre import Theatre
from scenarionet_sim.world import World

PART = 32
"""Scenarios of a part: what a killed run loses at most, a worker."""


@dataclass(frozen=True)
class Evaluation:
    """What is evaluated; picklable.

    Attributes:
        lake: The lake's folder.
        database: ``name@version``; None for the whole lake.
        snapshot: Number of the snapshot of the lake.
        policy: Who drives the ego: ``replay``, ``idm``, ``constant`` or ``module:Class``.
        traffic: Who drives the others: ``replay`` or ``idm``.
        backend: ``kinematic`` or ``bullet``.
        seed: Of the sensors' noise.
    """

    lake: str
    database: str | None
    snapshot: int
    policy: str
    traffic: str = "replay"
    backend: str = "kinematic"
    seed: int = 0

    @property
    def description(self) -> dict[str, Any]:
        """All that the results depend on."""
        spec = {name: value for name, value in asdict(self).items() if name != "lake"}
        return spec | {"part": PART, "software": software.name_and_version()}


@dataclass(frozen=True)
class Part:
    """Some scenarios of an evaluation: numbers ``first`` to before ``end``."""

    evaluation: Evaluation
    number: int
    first: int
    end: int
    run: runs.Run | None = None


@dataclass(frozen=True)
class Outcome:
    """What became of a part: (scenario id, how it ended, why it could not be simulated) of each scenario."""

    scenarios: list[tuple[str, str | None, str | None]]


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


Progress = Callable[[int, int, int], None]
"""Called with parts done, parts to do, scenarios done."""


def prepare(
    lake: str, database: str | None, policy: str, *, traffic: str = "replay", backend: str = "kinematic", seed: int = 0
) -> Evaluation:
    """An evaluation of what is in the lake now.

    Raises:
        NoSuchSnapshot, DatabaseNotFound: There is none.
        BadParameter: A name is unknown.
    """
    cast(policy, traffic)
    find_backend(backend)
    opened = Lake(lake)
    reference = None if database is None else opened.database(database).reference
    return Evaluation(str(opened.root), reference, opened.snapshot.number, policy, traffic, backend, seed)


def evaluate(
    evaluation: Evaluation,
    name: str,
    *,
    workers: int = 1,
    with_rollouts: bool = True,
    on_progress: Progress | None = None,
) -> Report:
    """Simulate what is not done yet, and write it into the lake.

    Args:
        evaluation: What.
        name: Of the run.
        workers: Processes.
        with_rollouts: Write what everybody did, not the metrics alone.
        on_progress: Told about every finished part.

    Raises:
        BadParameter: A run of that name is there and is another one.
        MissingDependency: A package that the backend needs is not installed.
        WorkerLost: A worker was killed; finished parts are kept.
    """
    started = time.monotonic()
    written = ("rollouts", "results") if with_rollouts else ("results",)
    run = runs.claim(LakeFiles(evaluation.lake), name, written, evaluation.description)
    parts, done = _parts(evaluation, run), run.done()
    left = [part for part in parts if part.number not in done]
    report = Report(name, sum(part.end - part.first for part in parts))
    report.skipped = report.scenarios - sum(part.end - part.first for part in left)
    finished = 0
    for number, outcome in enumerate(_outcomes(left, workers), start=1):
        finished += len(outcome.scenarios)
        report.broken += [(scenario_id, error) for scenario_id, _, error in outcome.scenarios if error]
        if on_progress:
            on_progress(number, len(left), finished)
    report.seconds = time.monotonic() - started
    return report


def find_broken(
    lake: str, database: str | None = None, *, workers: int = 1, on_progress: Progress | None = None
) -> list[tuple[str, str]]:
    """Scenarios whose recording cannot be replayed to its destination, with the reason; nothing is written."""
    parts = _parts(prepare(lake, database, "replay"), None)
    broken: list[tuple[str, str]] = []
    finished = 0
    for number, outcome in enumerate(_outcomes(parts, workers), start=1):
        finished += len(outcome.scenarios)
        for scenario_id, end, error in outcome.scenarios:
            if error or end != "success":
                broken.append((scenario_id, error or f"the replayed recording ends with {end}"))
        if on_progress:
            on_progress(number, len(parts), finished)
    return sorted(broken)


def _parts(evaluation: Evaluation, run: runs.Run | None) -> list[Part]:
    total = len(_scenarios(evaluation))
    return [
        Part(evaluation, number, first, min(first + PART, total), run)
        for number, first in enumerate(range(0, total, PART))
    ]


def _outcomes(parts: list[Part], workers: int) -> Iterator[Outcome]:
    if min(workers, len(parts)) <= 1:
        return map(simulate_part, parts)
    return run_pool(parts, min(workers, len(parts)), simulate_part)


@cache
def _scenarios(evaluation: Evaluation) -> ScenarioLoader:
    """Scenarios of an evaluation: looked up once a process."""
    return ScenarioLoader(Lake(evaluation.lake, evaluation.snapshot), evaluation.database)


# --- on a worker --------------------------------------------------------------------------------------


def simulate_part(part: Part) -> Outcome:
    """Simulate a part's scenarios, and publish the rows if it belongs to a run."""
    evaluation, loader = part.evaluation, _scenarios(part.evaluation)
    who = cast(evaluation.policy, evaluation.traffic)
    results: list[dict[str, Any]] = []
    rollouts: list[pa.Table] = []
    with Theatre(who.policies, find_backend(evaluation.backend), getattr(who.driver, "sensors", None)) as theatre:
        for index in range(part.first, part.end):
            row, rollout = _simulated(loader, index, theatre, who, evaluation.seed)
            results.append(row)
            rollouts += [rollout] if rollout is not None else []
    if part.run is not None:
        part.run.publish(part.number, {"results": results, "rollouts": together(rollouts)})
    return Outcome([(row["scenario_id"], row.get("status"), row.get("error")) for row in results])


def _simulated(
    loader: ScenarioLoader, index: int, theatre: Theatre, who: Cast, seed: int
) -> tuple[dict[str, Any], pa.Table | None]:
    scenario_id = loader.scenario_ids[index]
    try:
        world = World.from_scenario(loader[index])
        arena = theatre.arena(world)
        rollout = roll_out(arena, world, who.driver, np.random.default_rng([seed, index]))
        facts = {"scenario_id": scenario_id, "track_id": world.track_ids[rollout.agent]}
        return facts | measure(rollout, world), rollout_rows(rollout, world)
    except (MemoryError, MissingDependency):
        raise
    except Exception as error:  # whatever one scenario or a driver in it provokes, the others must go on
        theatre.clear()
        return {"scenario_id": scenario_id, "error": f"{type(error).__name__}: {error}"}, None
