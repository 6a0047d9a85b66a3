"""A part of an evaluation, which a worker simulates and scores.

Its rows depend only on the part, not on the worker or on the order. A scenario that fails to simulate becomes a row
with its error.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from itertools import islice
from pathlib import Path
from typing import Any

import pyarrow as pa

from scenarionet_data.storage import evaluation_runs
from scenarionet_sim.bridges.commonroad.by_name import is_outside, versions_of
from scenarionet_sim.drivers.by_name import REACTIVE, drives_alone, find_backend, is_model
from scenarionet_sim.drivers.code import PolicyCode, code_digest
from scenarionet_sim.evaluation.specification import Evaluation, scenarios_of
from scenarionet_sim.metrics.drive import DrivenEpisode
from scenarionet_sim.metrics.measure import measure_all
from scenarionet_sim.rollouts.batch import SLOTS, RolloutBatch, RolloutJob
from scenarionet_sim.rollouts.loading import loaded_ahead
from scenarionet_sim.rollouts.parts import Part
from scenarionet_sim.rollouts.rollout import Rollout
from scenarionet_sim.rollouts.span import EPISODES
from scenarionet_sim.rollouts.table import concat_rollouts, rollout_rows

_SCORED_TOGETHER = 32
"""Rollouts whose metrics are computed together: all of a part."""

ScenarioEnd = tuple[str, str | None, str | None]
"""Scenario id, how the episode ended, and the error if it could not be simulated."""


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


def ends_of_lost_part(job: EvaluationJob, reason: str) -> list[ScenarioEnd]:
    """Ends of a part that killed its worker; it has no rows, so the next run tries it again."""
    ids = scenarios_of(job.evaluation).scenario_ids
    numbers = (item // job.evaluation.rollouts for item in range(job.part.first, job.part.end))
    return [(ids[number], None, reason) for number in numbers]
