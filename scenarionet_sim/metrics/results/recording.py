"""Speed, and distance from the recording.

Average and final distance are those of the ScenarioNet paper's multi-agent evaluation: (1/T) sum of the distances
to the recorded positions over the shorter length, and the distance at its end.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from scenarionet_data.arrays.dtypes import Bool, Float64
from scenarionet_sim.metrics.drive import DrivenEpisode


def measure(episode: DrivenEpisode) -> dict[str, Any]:
    """Return the mean speed, and the distances from the recording."""
    rollout, world = episode.scored, episode.world
    recorded = world.log_position[rollout.start :, rollout.agent].astype(np.float64)
    valid = world.log_valid[rollout.start :, rollout.agent]
    average, final = displacement(rollout.position[:, rollout.agent], recorded, valid)
    return {
        "mean_speed": mean_speed(rollout.velocity[:, rollout.agent]),
        "average_displacement": average,
        "final_displacement": final,
    }


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
