"""Overlap with other objects: Waymax's ``overlap`` (definition). Heights do not count, nor who is at fault."""

from __future__ import annotations

import math

import numpy as np

from scenarionet_data.arrays.dtypes import Bool, Float64
from scenarionet_data.compiled.decorators import kernel
from scenarionet_sim.arrays.overlap import is_overlapping


@kernel
def overlaps(position: Float64, heading: Float64, size: Float64, present: Bool, row: int) -> Bool:
    """Return the moments (T,) at which the box of one object overlaps that of any other.

    Args:
        position: (T, N, 2) centres [m].
        heading: (T, N) [rad].
        size: (N, 2) length and width [m].
        present: (T, N).
        row: The object.
    """
    found = np.zeros(len(position), np.bool_)
    length, width = size[row, 0], size[row, 1]
    for t in range(len(position)):
        cos, sin = math.cos(heading[t, row]), math.sin(heading[t, row])
        for n in range(position.shape[1]):
            if found[t] or n == row or not present[t, n] or not present[t, row]:
                continue
            dx, dy = position[t, n, 0] - position[t, row, 0], position[t, n, 1] - position[t, row, 1]
            c, s = math.cos(heading[t, n]), math.sin(heading[t, n])
            found[t] = is_overlapping(dx, dy, (cos, sin, length, width), (c, s, size[n, 0], size[n, 1]))
    return found
