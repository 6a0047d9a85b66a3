"""Boxes that overlap that of one object, moment by moment."""

from __future__ import annotations

import math

from scenarionet_data.arrays.dtypes import Bool, Float64
from scenarionet_data.compiled.decorators import kernel
from scenarionet_sim.arrays.overlap import is_overlapping


@kernel(allocates=False)
def keep_overlaps(
    position: Float64, heading: Float64, size: Float64, others: Float64, other_heading: Float64, other_size: Float64,
    present: Bool,
) -> None:  # fmt: skip
    """Clear the entries (T, N) of objects whose box does not overlap that of one at that moment."""
    for t in range(len(position)):
        cos, sin = math.cos(heading[t]), math.sin(heading[t])
        for n in range(others.shape[1]):
            if not present[t, n]:
                continue
            dx, dy = others[t, n, 0] - position[t, 0], others[t, n, 1] - position[t, 1]
            length, width = other_size[n, 0], other_size[n, 1]
            reach = size[0] + size[1] + length + width  # at least twice the sum of both circumscribed radii
            present[t, n] = 4.0 * (dx * dx + dy * dy) <= reach * reach
            if present[t, n]:
                c, s = math.cos(other_heading[t, n]), math.sin(other_heading[t, n])
                present[t, n] = is_overlapping(dx, dy, (cos, sin, size[0], size[1]), (c, s, length, width))
