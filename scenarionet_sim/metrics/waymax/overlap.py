"""Overlap with other objects: Waymax's ``overlap`` (definition). Heights do not count, nor who is at fault."""

from __future__ import annotations

import numpy as np

from scenarionet_data.arrays.dtypes import Bool, Float64
from scenarionet_sim.metrics.overlap import keep_overlaps


def overlaps(position: Float64, heading: Float64, size: Float64, present: Bool, row: int) -> Bool:
    """Return the moments (T,) at which the box of one object overlaps that of any other.

    Args:
        position: (T, N, 2) centres [m].
        heading: (T, N) [rad].
        size: (N, 2) length and width [m].
        present: (T, N).
        row: The object.
    """
    touched = present & present[:, [row]]
    touched[:, row] = False
    position, heading = np.ascontiguousarray(position), np.ascontiguousarray(heading)
    keep_overlaps(position[:, row].copy(), heading[:, row].copy(), size[row], position, heading, size, touched)
    is_touched: Bool = np.any(touched, axis=1)
    return is_touched
