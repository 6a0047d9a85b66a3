"""PDMS and EPDMS: the scores of plans from their parts.

Source: navsim, ``docs/metrics.md``, ``planner/pdm_planner/scoring/pdm_scorer.py`` and ``evaluate/pdm_score.py``
(weights and filter).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields, replace

import numpy as np

from scenarionet_data.arrays.dtypes import Float64
from scenarionet_sim.metrics.drive import EgoDrive
from scenarionet_sim.metrics.navsim.comfort import is_history_comfortable, is_plan_comfortable
from scenarionet_sim.metrics.navsim.parts import measure_plan
from scenarionet_sim.metrics.navsim.scene import PlanScene

MULTIPLIERS = (
    "no_at_fault_collisions",
    "drivable_area_compliance",
    "driving_direction_compliance",
    "traffic_light_compliance",
)
MIN_PROGRESS = 5.0
"""Way of the best plan up to which every plan makes full progress [m]."""


@dataclass(frozen=True)
class PlanParts:
    """Parts of the scores of a plan, from 0 to 1.

    Attributes:
        no_at_fault_collisions, drivable_area_compliance, driving_direction_compliance, traffic_light_compliance:
            Multipliers; the last two in EPDMS only.
        ego_progress: Relative to the best plan.
        time_to_collision_within_bound: Whether it keeps 0.9 s.
        lane_keeping: EPDMS only.
        comfort: Of the plan alone, PDMS only.
        history_comfort: After the motion before it, EPDMS only.
        extended_comfort: Beside the plan of the frame before, EPDMS only; None without one, which leaves it out.
    """

    no_at_fault_collisions: float
    drivable_area_compliance: float
    driving_direction_compliance: float
    traffic_light_compliance: float
    ego_progress: float
    time_to_collision_within_bound: float
    lane_keeping: float
    comfort: float
    history_comfort: float
    extended_comfort: float | None = None


def pdms(parts: PlanParts) -> float:
    """The score of NAVSIM v1: NC · DAC · (5 EP + 5 TTC + 2 C) / 12."""
    weighted = 5.0 * parts.ego_progress + 5.0 * parts.time_to_collision_within_bound + 2.0 * parts.comfort
    return parts.no_at_fault_collisions * parts.drivable_area_compliance * weighted / 12.0


def epdms(parts: PlanParts, human: PlanParts | None = None) -> float:
    """The score of NAVSIM v2: NC · DAC · DDC · TLC · (5 EP + 5 TTC + 2 LK + 2 HC + 2 EC) / 16.

    Args:
        parts: Parts of the plan.
        human: Parts of the recorded drive, which filter those of the plan; None for no filter.
    """
    kept = parts if human is None else filter_by_human(parts, human)
    weighted = (
        5.0 * kept.ego_progress
        + 5.0 * kept.time_to_collision_within_bound
        + 2.0 * kept.lane_keeping
        + 2.0 * kept.history_comfort
    )
    total = 14.0
    if kept.extended_comfort is not None:
        weighted, total = weighted + 2.0 * kept.extended_comfort, 16.0
    multipliers = kept.no_at_fault_collisions * kept.drivable_area_compliance
    return multipliers * kept.driving_direction_compliance * kept.traffic_light_compliance * weighted / total


def filter_by_human(parts: PlanParts, human: PlanParts) -> PlanParts:
    """Set the parts to 1 in which the recorded drive has 0: then the scene demands the violation.

    Three parts are never set, whatever the recorded drive was scored with: NAVSIM scores it alone, so that its progress
    is 1, without its history, and compares frames only afterwards (its documentation has the filter there, too).
    """
    kept = {"ego_progress", "history_comfort", "extended_comfort"}
    failed = {field.name for field in fields(parts) if getattr(human, field.name) == 0.0} - kept
    return replace(parts, **dict.fromkeys(failed, 1.0))


def normalised_progress(progress: Float64, multipliers: Float64) -> Float64:
    """Progress (P,) relative to the best plan without violations.

    Args:
        progress: (P,) [m].
        multipliers: (P,) products of the plans' multipliers.
    """
    best = float((progress * multipliers).max())
    return np.clip(progress / best, 0.0, 1.0) if best > MIN_PROGRESS else np.ones(len(progress))


def score_plans(plans: Sequence[EgoDrive], scene: PlanScene, history: EgoDrive | None = None) -> list[PlanParts]:
    """Return the parts of plans for the same scene; they compete in progress.

    The owner lets the plan of its planner PDM-Closed compete, too: give it, or another good plan, among them.

    Args:
        plans: As simulated, 4 s long with 10 poses a second in the challenge.
        scene: Their surroundings.
        history: Recorded motion before the plans; without it they are comfortable after it.
    """
    measured = [measure_plan(plan, scene) for plan in plans]
    multipliers = np.array([np.prod([each[name] for name in MULTIPLIERS]) for each in measured])
    ways = normalised_progress(np.array([each.pop("progress") for each in measured]), multipliers)
    return [
        PlanParts(
            **each,
            ego_progress=float(way),
            comfort=float(is_plan_comfortable(plan)),
            history_comfort=float(history is None or is_history_comfortable(history, plan)),
        )
        for plan, each, way in zip(plans, measured, ways, strict=True)
    ]
