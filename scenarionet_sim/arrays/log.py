"""Columns of recorded and simulated motion, and which recorded positions form a path."""

from __future__ import annotations

import numpy as np

from scenarionet_data.arrays.dtypes import Bool, Float32, Float64, Int32
from scenarionet_data.compiled.decorators import kernel
from scenarionet_sim.arrays.minmax import larger, smaller

X, Y, Z, HEADING, VX, VY, YAW_RATE, VALID = range(8)
"""Columns of a log (T, N, 8): position [m], heading [rad], velocity [m/s], yaw rate [rad/s], 1 where valid.

The first seven are also the columns of ``State.motion``, the first four those of ``Paths.path``.
"""

ARC = 4
"""Column of ``Paths.path`` with the arc length [m]."""


@kernel(allocates=False)
def write_log(
    position: Float32,
    heading: Float32,
    velocity: Float32,
    valid: Bool,
    timestamps: Float64,
    log: Float32,
    extents: Float32,
) -> None:
    """Write tracks as a log, with yaw rates by central differences over valid neighbours.

    Args:
        position, heading, velocity, valid: (N, T, 3) [m], (N, T) [rad], (N, T, 2) [m/s], (N, T).
        timestamps: (T,) [s].
        log: (T, N, 8) output; zeros where not valid.
        extents: (4,) output: min_x, min_y, max_x, max_y [m] of what is valid.
    """
    extents[0], extents[1], extents[2], extents[3] = np.inf, np.inf, -np.inf, -np.inf
    for n in range(valid.shape[0]):
        for t in range(valid.shape[1]):
            row = log[t, n]
            if not valid[n, t]:
                for column in range(log.shape[2]):
                    row[column] = 0.0
                continue
            before = t - 1 if t > 0 and valid[n, t - 1] else t
            after = t + 1 if t + 1 < valid.shape[1] and valid[n, t + 1] else t
            turn, span = np.float64(heading[n, after]) - heading[n, before], timestamps[after] - timestamps[before]
            turn -= 2.0 * np.pi * np.floor(turn / (2.0 * np.pi) + 0.5)
            row[X], row[Y], row[Z] = position[n, t, X], position[n, t, Y], position[n, t, Z]
            row[HEADING], row[VX], row[VY] = heading[n, t], velocity[n, t, 0], velocity[n, t, 1]
            row[YAW_RATE] = turn / span if span > 0.0 else 0.0
            row[VALID] = 1.0
            for axis in range(2):
                extents[axis] = smaller(extents[axis], row[axis])
                extents[2 + axis] = larger(extents[2 + axis], row[axis])


@kernel(allocates=False)
def trace(log: Float32, is_kept: Bool, path: Float32, offsets: Int32, turns_back: Bool) -> None:
    """Write the selected positions as paths, one object after another.

    Args:
        log: (T, N, 8).
        is_kept: (N, T) see :func:`thin`.
        path: (P, 5) output: x, y, z, heading and arc length.
        offsets: (N + 1,) output: rows of each object's path.
        turns_back: (N,) output: whether the path turns by more than a right angle anywhere.
    """
    row, total, offsets[0] = 0, 0.0, 0
    for n in range(log.shape[1]):
        first, began, dx, dy = row, 0.0, 0.0, 0.0
        turns_back[n] = False
        for t in range(log.shape[0]):
            if not is_kept[n, t]:
                continue
            for column in range(ARC):
                path[row, column] = log[t, n, column]
            if row:
                ax, ay = np.float64(path[row, X]) - path[row - 1, X], np.float64(path[row, Y]) - path[row - 1, Y]
                total += np.hypot(ax, ay)
                turns_back[n] |= row > first + 1 and ax * dx + ay * dy < 0.0
                dx, dy = ax, ay
            began = total if row == first else began
            path[row, ARC] = total - began
            row += 1
        offsets[n + 1] = row


@kernel(allocates=False)
def thin(log: Float32, spacing: float, is_kept: Bool) -> None:
    """Select the recorded positions of each object's path: the first, then each ``spacing`` from the last selected.

    Args:
        log: (T, N, 8).
        spacing: Least distance between points [m].
        is_kept: (N, T) output.
    """
    for n in range(log.shape[1]):
        x, y = np.inf, np.inf
        for t in range(log.shape[0]):
            row = log[t, n]
            is_kept[n, t] = row[VALID] != 0.0 and not np.hypot(row[X] - x, row[Y] - y) < spacing
            if is_kept[n, t]:
                x, y = row[X], row[Y]
