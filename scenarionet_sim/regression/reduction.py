"""The smallest scenario in which a policy still fails in the same way: fewest road users, then the shortest window."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import TypeVar

import numpy as np

from scenarionet_data import ScenarioDescription
from scenarionet_data.arrays.dtypes import IntP
from scenarionet_data.variations.moment_windows import MomentWindow, cut_out
from scenarionet_sim.drivers.by_name import find_backend
from scenarionet_sim.evaluation.receipts import trajectory_digests
from scenarionet_sim.evaluation.specification import Evaluation, scenarios_of
from scenarionet_sim.metrics.measure import measure
from scenarionet_sim.regression.failures import failure_kind, severity
from scenarionet_sim.rollouts.batch import RolloutBatch, RolloutJob
from scenarionet_sim.rollouts.span import EPISODES
from scenarionet_sim.rollouts.table import rollout_rows
from scenarionet_sim.worlds.world import World

Kept = TypeVar("Kept")

_AFTER = (0.2, 1.0, 3.0)
_SHARES = (0.125, 0.25, 0.5, 0.75)
"""Where a scenario is tried to end: seconds after a contact; of other failures, shares of its length."""

_LENGTHS = (1.2, 2.0, 3.0, 4.0, 6.0, 8.0, 12.0)
"""Lengths of the windows that are tried [s]."""


@dataclass(frozen=True)
class DrivenFailure:
    """How a drive went.

    Attributes:
        kind: See :func:`~scenarionet_sim.regression.failures.failure_kind`.
        partner: The track that it touches first; empty for other failures.
        time: When, since the first timestep of the scenario [s]; NaN for other failures.
        digest: Of the trajectories of all objects.
    """

    kind: str
    partner: str
    time: float
    digest: str


@dataclass(frozen=True)
class ReductionJob:
    """A failure to reduce: the evaluation of the policy that fails, and the scenario."""

    evaluation: Evaluation
    scenario_id: str


@dataclass(frozen=True)
class Reduction:
    """Ever smaller scenarios in which the policy fails in the same way, the whole one first.

    Attributes:
        scenarios: The scenarios.
        failures: The failure in each.
    """

    scenarios: tuple[ScenarioDescription, ...]
    failures: tuple[DrivenFailure, ...]


def fewest(items: Sequence[Kept], fails: Callable[[Sequence[Kept]], bool]) -> list[Kept]:
    """Return items of which none can be left out so that it still fails (Zeller and Hildebrandt 2002).

    Args:
        items: Fails with all of them.
        fails: Whether it fails with some of them.
    """
    kept, parts = list(items), 2
    while kept:
        size = math.ceil(len(kept) / parts)
        for first in range(0, len(kept), size):
            rest = kept[:first] + kept[first + size :]
            if fails(rest):
                kept, parts = rest, max(parts - 1, 2)
                break
        else:
            if size == 1:
                break
            parts = min(2 * parts, len(kept))
    return kept


class DriveOnce:
    """Drives a policy through scenarios that need not be in a lake.

    Args:
        evaluation: The policy and the conditions.
    """

    def __init__(self, evaluation: Evaluation) -> None:
        self._evaluation = evaluation
        self._batch = RolloutBatch(evaluation.drivers(), find_backend(evaluation.backend), slots=1)

    def __call__(self, scenario: ScenarioDescription) -> DrivenFailure:
        """Return how it goes; what cannot be simulated is a failure, too."""
        span, duration = EPISODES[self._evaluation.episode], float(scenario.timestamps[-1])
        world = World.from_scenario(scenario)
        start = span.start(scenario, world)
        seed = (self._evaluation.seed, 0, 0)
        job = RolloutJob(0, world, seed, start, span.num_steps(world, start), span.waits)
        ((_, rollout),) = self._batch.run([job])
        if isinstance(rollout, Exception):
            return DrivenFailure(failure_kind({"error": str(rollout) or "an error"}, duration), "", math.nan, "")
        row = measure(rollout, world)
        (digest,) = trajectory_digests(rollout_rows(rollout, world, 0)).values()
        kind = failure_kind(row, duration)
        if not kind.startswith("collision"):
            return DrivenFailure(kind, "", math.nan, digest)
        crashes = rollout.contacts[1:] & ~rollout.contacts[:-1]
        first = int(np.flatnonzero(crashes.any(axis=1))[0])
        partner = str(world.track_ids[int(np.argmax(crashes[first]))])
        return DrivenFailure(kind, partner, (start + first + 1) * world.dt, digest)


def reduce_failure(job: ReductionJob) -> Reduction | None:
    """Reduce a failure, in the process of the policy; None if it does not fail when it drives this scenario alone."""
    drive = DriveOnce(job.evaluation)
    (scenario,) = scenarios_of(replace(job.evaluation, database=(job.scenario_id,)))
    whole = drive(scenario)
    found, failures = [scenario], [whole]
    if not whole.kind:
        return None

    def fails_alike(candidate: ScenarioDescription) -> bool:
        failure = drive(candidate)
        if (failure.kind, failure.partner) != (whole.kind, whole.partner):
            return False
        found.append(candidate)
        failures.append(failure)
        return True

    ego = scenario.ego_index
    others = [row for row in range(len(scenario.tracks)) if row != ego]
    partners = [row for row in others if scenario.tracks.ids[row] == whole.partner]
    if len(others) > len(partners) and not fails_alike(_with_rows(scenario, [ego, *partners])):
        fewest(others, lambda rows: fails_alike(_with_rows(scenario, [ego, *rows])))
    fewer, time, length = found[-1], failures[-1].time, float(scenario.timestamps[-1])
    ends = [time + after for after in _AFTER] if math.isfinite(time) else [share * length for share in _SHARES]
    for end in ends:
        if any(map(fails_alike, _window(fewer, 0.0, end))):
            break
    end = float(found[-1].timestamps[-1])
    any(fails_alike(each) for length in _LENGTHS for each in _window(found[-1], end - length, end))  # up to the first
    return Reduction(tuple(found), tuple(failures))


def smallest_passing(job: tuple[Evaluation, Reduction]) -> tuple[str, int]:
    """Return the number of the smallest scenario that another policy does not fail so badly; the whole one at last."""
    evaluation, reduction = job
    drive, limit = DriveOnce(evaluation), severity(reduction.failures[0].kind)
    numbers = range(len(reduction.scenarios) - 1, 0, -1)
    passing = (number for number in numbers if severity(drive(reduction.scenarios[number]).kind) < limit)
    return reduction.scenarios[0].id, next(passing, 0)


def drive_stored(job: ReductionJob) -> tuple[str, DrivenFailure]:
    """Return how a policy drives through a scenario of the lake."""
    (scenario,) = scenarios_of(replace(job.evaluation, database=(job.scenario_id,)))
    return job.scenario_id, DriveOnce(job.evaluation)(scenario)


def _with_rows(scenario: ScenarioDescription, rows: Sequence[int]) -> ScenarioDescription:
    """The scenario with some of its road users."""
    kept: IntP = np.sort(np.array(rows, np.intp))
    return scenario.with_tracks(scenario.tracks.take(kept))


def _window(scenario: ScenarioDescription, begin: float, end: float) -> list[ScenarioDescription]:
    """The scenario between two times, with the ego as it was recorded; none if it is not there, or it is no less."""
    times = scenario.timestamps
    first = max(int(np.searchsorted(times, begin - 1e-6)), 0)
    last = min(int(np.searchsorted(times, end - 1e-6)), len(times) - 1)
    if last - first >= len(times) - 1 or last <= first or not scenario.tracks.valid[scenario.ego_index, first]:
        return []
    return [cut_out(scenario, MomentWindow("failure", first, last), 0.0)]
