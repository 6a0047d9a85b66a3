"""Speed, progress, and distance from the recording.

Average and final distance are those of the ScenarioNet paper's multi-agent evaluation: (1/T) sum of the distances
to the recorded positions over the shorter length, and the distance at its end.
"""

from __future__ import annotations

import numpy as np

from scenarionet_data.arrays.dtypes import Bool, Float64

_MIN_PROGRESS = 2.0
"""Lower bound of both distances in the ratio; reversing by more gives a ratio of 0 [m]."""


def mean_speed(velocity: Float64) -> float:
    """Return the mean speed [m/s] of velocities (T, 2)."""
    return float(np.hypot(*velocity.T).mean())


def displacement(position: Float64, recorded: Float64, valid: Bool) -> tuple[float, float]:
    """Return average and final distance from the recording [m].

    Args:
        position: (T, 2) simulated [m].
        recorded: (R, 2) log of the same object from the same moment on [m].
        valid: (R,) valid timesteps of the log.

    Returns:
        Both NaN if no moment of the episode is valid in the log.
    """
    shorter = min(len(position), len(recorded))
    apart = np.linalg.norm(position[:shorter] - recorded[:shorter], axis=1)[valid[:shorter]]
    return (float(apart.mean()), float(apart[-1])) if len(apart) else (np.nan, np.nan)


def progress_ratio(driven: float, recorded: float) -> float:
    """Return the share of the recorded progress along the route, as nuPlan's ``ego_progress_along_expert_route``.

    Args:
        driven, recorded: Progress of the driver, and of the recording [m].
    """
    if driven < -_MIN_PROGRESS:
        return 0.0
    return min(1.0, max(driven, _MIN_PROGRESS) / max(recorded, _MIN_PROGRESS))
