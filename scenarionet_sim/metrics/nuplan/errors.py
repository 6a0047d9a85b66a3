"""Distance from the recorded drive: nuPlan's open-loop metrics and ``ego_expert_l2_error``.

Source: nuplan-devkit, ``planning/metrics/utils/expert_comparisons.py`` and ``planner_expert_*`` (definitions).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from scenarionet_data.arrays.dtypes import Float64

HORIZONS = (3, 5, 8)
"""Horizons of a plan [s]."""

MISS_DISTANCES = (6.0, 8.0, 16.0)
"""Largest distance within each horizon beyond which a plan misses [m]."""

MAX_MISS_RATE = 0.3
MAX_AVERAGE_DISTANCE = MAX_FINAL_DISTANCE = 8.0  # [m]
MAX_AVERAGE_HEADING = MAX_FINAL_HEADING = 0.8  # [rad]


def expert_distance(position: Float64, recorded: Float64) -> Float64:
    """Distance (T,) from the recorded positions (T, 2) [m]."""
    found: Float64 = np.hypot(*(position - recorded).T)
    return found


def expert_distance_with_yaw(
    position: Float64, heading: Float64, recorded: Float64, recorded_heading: Float64, weight: float = 2.5
) -> Float64:
    """Distance [m] plus ``weight`` [m/rad] times the difference of headings, (T,)."""
    return expert_distance(position, recorded) + weight * heading_error(heading, recorded_heading)


def heading_error(heading: Float64, recorded: Float64) -> Float64:
    """Absolute difference of headings [rad]."""
    return np.abs((heading - recorded + np.pi) % (2.0 * np.pi) - np.pi)


@dataclass(frozen=True, eq=False)
class PlanErrors:
    """Errors of F plans over the horizons.

    Attributes:
        average_distance, final_distance, largest_distance: (H, F) [m].
        average_heading, final_heading: (H, F) [rad].
    """

    average_distance: Float64
    final_distance: Float64
    largest_distance: Float64
    average_heading: Float64
    final_heading: Float64

    @property
    def miss_rates(self) -> Float64:
        """(H,) share of plans that miss, by horizon."""
        rates: Float64 = np.mean(self.largest_distance > np.array(MISS_DISTANCES)[:, None], axis=1)
        return rates

    @property
    def is_hit(self) -> bool:
        """Whether few enough plans miss at every horizon."""
        return bool((self.miss_rates <= MAX_MISS_RATE).all())

    @property
    def open_loop_score(self) -> float:
        """NuPlan's open-loop score: 0 if plans miss, else the mean of four errors' scores, the headings' doubled."""
        parts = (
            (1.0, self.average_distance, MAX_AVERAGE_DISTANCE),
            (1.0, self.final_distance, MAX_FINAL_DISTANCE),
            (2.0, self.average_heading, MAX_AVERAGE_HEADING),
            (2.0, self.final_heading, MAX_FINAL_HEADING),
        )
        total = sum(weight * bounded_score(errors, limit) for weight, errors, limit in parts)
        return float(self.is_hit) * total / sum(weight for weight, _, _ in parts)


def bounded_score(errors: Float64, limit: float) -> float:
    """1 without an error, 0 from a mean error of ``limit`` on."""
    return max(0.0, 1.0 - float(errors.mean(axis=1).mean()) / limit)


def plan_errors(
    distance: Float64, heading: Float64, frequency: int = 1, horizons: Sequence[int] = HORIZONS
) -> PlanErrors:
    """Errors of plans.

    Args:
        distance: (F, K) distance of each plan's states from the recording [m].
        heading: (F, K) difference of headings [rad].
        frequency: States of a plan in a second.
        horizons: [s].
    """
    ends = [horizon * frequency for horizon in horizons]
    return PlanErrors(
        np.array([distance[:, :end].mean(axis=1) for end in ends]),
        np.array([distance[:, end - 1] for end in ends]),
        np.array([distance[:, :end].max(axis=1) for end in ends]),
        np.array([heading[:, :end].mean(axis=1) for end in ends]),
        np.array([heading[:, end - 1] for end in ends]),
    )
