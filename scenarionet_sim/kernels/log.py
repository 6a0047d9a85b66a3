"""Recorded tracks as the simulator reads them: one row of numbers per timestep and object."""

from __future__ import annotations

import numpy as np

from scenarionet_data.arrays.compiled import kernel
from scenarionet_data.arrays.dtypes import Bool, Float32, Float64

X, Y, Z, HEADING, VX, VY, YAW_RATE, VALID = range(8)
"""Columns of a log."""


@kernel
def pack_log(
    position: Float32, heading: Float32, velocity: Float32, valid: Bool, timestamps: Float64, log: Float32
) -> None:
    """Transposes tracks and adds yaw rates: central differences over valid neighbours, as for velocities.

    Args:
        position, heading, velocity, valid: (N, T, 3), (N, T), (N, T, 2), (N, T) as in ``Tracks``.
        timestamps: (T,) [s].
        log: (T, N, 8) of zeros, written where valid: x, y, z [m], heading [rad], vx, vy [m/s], yaw rate [rad/s], 1.
    """
    num_objects, num_steps = valid.shape
    for n in range(num_objects):
        for t in range(num_steps):
            if not valid[n, t]:
                continue
            row = log[t, n]
            before = t - 1 if t > 0 and valid[n, t - 1] else t
            after = t + 1 if t + 1 < num_steps and valid[n, t + 1] else t
            row[X], row[Y], row[Z] = position[n, t, 0], position[n, t, 1], position[n, t, 2]
            row[HEADING], row[VX], row[VY] = heading[n, t], velocity[n, t, 0], velocity[n, t, 1]
            if after > before:
                turn = np.float64(heading[n, after]) - np.float64(heading[n, before])
                turn -= 2.0 * np.pi * np.floor(turn / (2.0 * np.pi) + 0.5)
                row[YAW_RATE] = turn / (timestamps[after] - timestamps[before])
            row[VALID] = 1.0


@kernel
def thin(log: Float32, spacing: float, is_kept: Bool) -> None:
    """Which recorded positions make an object's path: the first, then each at least ``spacing`` from the last kept.

    Args:
        log: (T, N, 8).
        spacing: [m]
        is_kept: (N, T) written.
    """
    for n in range(log.shape[1]):
        x, y = np.inf, np.inf
        for t in range(log.shape[0]):
            row = log[t, n]
            is_kept[n, t] = row[VALID] != 0.0 and not np.hypot(row[X] - x, row[Y] - y) < spacing
            if is_kept[n, t]:
                x, y = row[X], row[Y]
