"""Results of a policy on scenarios: those that the lake has already from the same policy are not simulated again.

A deterministic policy with the same code on the same scenario under the same conditions acts alike, because equal
observations give equal actions. Whether a policy is deterministic is found by repeating some scenarios.
"""

from __future__ import annotations

import hashlib
import json
import uuid
from dataclasses import dataclass, replace
from typing import Literal

from scenarionet_data import Lake
from scenarionet_data.errors import BadParameter, NoSuchSnapshot
from scenarionet_data.execution.executors import run_serially
from scenarionet_data.execution.progress import Progress
from scenarionet_data.storage import evaluation_runs
from scenarionet_sim.drivers.own_process import executor_of
from scenarionet_sim.evaluation.evaluation import run_evaluation
from scenarionet_sim.evaluation.parts import EvaluationJob, simulate
from scenarionet_sim.evaluation.receipts import content_digests, trajectory_digests
from scenarionet_sim.evaluation.specification import Evaluation, scenarios_of
from scenarionet_sim.rollouts.parts import Part

Determinism = Literal["deterministic", "random, by its seed", "random, by more than its seed"]

PREFIX = "regression"
"""Of the names of runs, which end with a digest of the policy and the conditions, and a number."""

REPEATED = 8
"""Scenarios that are repeated to find out whether a policy is deterministic."""


@dataclass(frozen=True)
class KnownOutcomes:
    """Where the results of a policy are.

    Attributes:
        policy: The pinned policy.
        determinism: What repeating some scenarios has shown.
        runs: Runs of the lake; of a scenario in several, the last one counts.
        simulated, reused: Scenarios that were simulated now, and before.
    """

    policy: str
    determinism: Determinism
    runs: tuple[str, ...]
    simulated: int
    reused: int


def find_outcomes(
    evaluation: Evaluation, *, workers: int = 1, fresh: bool = False, on_progress: Progress | None = None
) -> KnownOutcomes:
    """Simulate a policy on the scenarios whose results the lake does not have from it.

    Args:
        evaluation: The policy, scenarios and conditions.
        workers: Number of processes.
        fresh: Simulate all scenarios again.
        on_progress: Called after each finished part.

    Raises:
        BadParameter: There are no scenarios.
        WorkerLost: As :func:`~scenarionet_sim.evaluate`.
    """
    ids = list(scenarios_of(evaluation).scenario_ids)
    if not ids:
        raise BadParameter(f"{evaluation.database or evaluation.lake}: no scenarios, nothing to compare")
    determinism = determinism_of(evaluation)
    lake = Lake(evaluation.lake)
    conditions = {key: value for key, value in evaluation.description.items() if key not in ("database", "snapshot")}
    key = f"{PREFIX}-{hashlib.sha256(json.dumps(conditions, sort_keys=True).encode()).hexdigest()[:12]}"
    runs = [each for each in evaluation_runs.names(lake.files) if each.startswith(f"{key}-")]
    if determinism != "deterministic" or fresh:
        name = f"{key}-{len(runs):04d}-{uuid.uuid4().hex[:8]}"
        run_evaluation(evaluation, name, workers=workers, on_progress=on_progress)
        return KnownOutcomes(evaluation.policy, determinism, (name,), len(ids), 0)
    known = _known(lake, evaluation, runs)
    missing = tuple(each for each in ids if each not in known)
    if missing:
        runs.append(f"{key}-{len(runs):04d}-{uuid.uuid4().hex[:8]}")
        run_evaluation(replace(evaluation, database=missing), runs[-1], workers=workers, on_progress=on_progress)
    return KnownOutcomes(evaluation.policy, determinism, tuple(runs), len(missing), len(ids) - len(missing))


def determinism_of(evaluation: Evaluation) -> Determinism:
    """Repeat some scenarios, with the same seed and with another one, and compare them bit by bit."""
    ids = scenarios_of(evaluation).scenario_ids
    few = tuple(ids[:: max(len(ids) // REPEATED, 1)][:REPEATED])
    jobs = [
        EvaluationJob(replace(evaluation, database=few, seed=seed, rollouts=1), Part(0, 0, len(few)), None)
        for seed in (evaluation.seed, evaluation.seed + 1, evaluation.seed)
    ]
    executor = executor_of(evaluation.policy, evaluation.python, 1) or run_serially
    first, other, again = executor(jobs, driven_digests)
    if first != again:
        return "random, by more than its seed"
    return "deterministic" if first == other else "random, by its seed"


def driven_digests(job: EvaluationJob) -> tuple[str, ...]:
    """Simulate a part; return a digest of each trajectory, and the errors of what has none."""
    rows, rollouts = simulate(job)
    errors = sorted(f"{row['scenario_id']}: {row['error']}" for row in rows if row.get("error"))
    return (*sorted(map(str, trajectory_digests(rollouts).items())), *errors)


def _known(lake: Lake, evaluation: Evaluation, runs: list[str]) -> set[str]:
    """Scenarios whose outcome is known: with the content of today, and without an error."""
    known: set[str] = set()
    for run in runs:
        rows = evaluation_runs.rows(lake.files, run, "results").select(["scenario_id", "error"]).to_pylist()
        ids = {row["scenario_id"] for row in rows} - {row["scenario_id"] for row in rows if row["error"] is not None}
        snapshot = evaluation_runs.describe(lake.files, run)["snapshot"]
        now = content_digests(Lake(lake.root, evaluation.snapshot), sorted(ids))
        try:
            then = now if snapshot == evaluation.snapshot else content_digests(Lake(lake.root, snapshot), sorted(ids))
        except NoSuchSnapshot:  # expired: nothing says which content was simulated
            continue
        changed = {each for each in ids if then.get(each) != now.get(each)}
        known = (known | ids) - changed
    return known
