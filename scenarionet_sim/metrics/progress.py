"""How far and how fast: speed, and how far from the recording.

Average and final distance are those of the ScenarioNet paper's multi-agent evaluation: (1/T) sum of the distances
to the recorded positions over the shorter length, and the distance at its end.
"""

from __future__ import annotations

import numpy as np

from scenarionet_data.arrays.dtypes import Bool, Float64

_MIN_PROGRESS = 2.0
"""[m] Less than that by the recording counts as that, and driving back further than that is no progress at all."""


def mean_speed(velocity: Float64) -> float:
    """Mean of the speed [m/s] over (T, 2) velocities."""
    return float(np.hypot(*velocity.T).mean())


def displacement(position: Float64, recorded: Float64, valid: Bool) -> tuple[float, float]:
    """Average and final distance [m] to the recording.

    Args:
        position: (T, 2) driven.
        recorded: (R, 2) the same object's log from the same moment on.
        valid: (R,) where it was recorded.

    Returns:
        Both NaN when no moment of the episode was recorded.
    """
    shorter = min(len(position), len(recorded))
    apart = np.linalg.norm(position[:shorter] - recorded[:shorter], axis=1)[valid[:shorter]]
    return (float(apart.mean()), float(apart[-1])) if len(apart) else (np.nan, np.nan)


def progress_ratio(driven: float, recorded: float) -> float:
    """Share of the recorded progress along the route, as nuPlan's ``ego_progress_along_expert_route``.

    Args:
        driven, recorded: Progress [m] of the driver and of the recording.
    """
    if driven < -_MIN_PROGRESS:
        return 0.0
    return min(1.0, max(driven, _MIN_PROGRESS) / max(recorded, _MIN_PROGRESS))
