"""Columns of recorded and simulated motion, and which recorded positions form a path."""

from __future__ import annotations

import numpy as np

from scenarionet_data.arrays.compiled import kernel
from scenarionet_data.arrays.dtypes import Bool, Float32

X, Y, Z, HEADING, VX, VY, YAW_RATE, VALID = range(8)
"""Columns of a log (T, N, 8): position [m], heading [rad], velocity [m/s], yaw rate [rad/s], 1 where valid.

The first seven are also the columns of ``State.motion``, the first four those of ``Paths.path``.
"""

ARC = 4
"""Column of ``Paths.path`` with the arc length [m]."""


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
