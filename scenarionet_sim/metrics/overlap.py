"""Boxes that overlap that of one object, moment by moment."""

from __future__ import annotations

import math

from scenarionet_data.arrays.dtypes import Bool, Float64, Int64
from scenarionet_data.compiled.decorators import device_function, kernel
from scenarionet_sim.arrays.overlap import is_overlapping
from scenarionet_sim.metrics.drive import Drives, MovingBoxes

MARGIN = 1e-6
"""Added to sizes of boxes before an exact decision [m], as rounding must not exclude boxes that just touch."""


@kernel(allocates=False)
def keep_overlaps(
    position: Float64, heading: Float64, size: Float64, others: Float64, other_heading: Float64, other_size: Float64,
    present: Bool,
) -> None:  # fmt: skip
    """Clear the entries (T, N) of objects whose box does not overlap that of one at that moment."""
    for t in range(len(position)):
        box = math.cos(heading[t]), math.sin(heading[t]), size[0], size[1]
        for n in range(others.shape[1]):
            if present[t, n]:
                dx, dy = others[t, n, 0] - position[t, 0], others[t, n, 1] - position[t, 1]
                present[t, n] = _touches(dx, dy, box, other_heading[t, n], other_size[n, 0], other_size[n, 1])


@device_function
def _touches(
    dx: float, dy: float, box: tuple[float, float, float, float], heading: float, length: float, width: float
) -> bool:
    """Return whether a box overlaps another one; (dx, dy) leads to the centre of that."""
    reach = box[2] + box[3] + length + width  # at least twice the sum of both circumscribed radii
    if 4.0 * (dx * dx + dy * dy) > reach * reach:
        return False
    return is_overlapping(dx, dy, box, (math.cos(heading), math.sin(heading), length, width))


@kernel(allocates=False)
def count_overlaps(drives: Drives, boxes: MovingBoxes, steps: Int64, margin: float) -> None:
    """Write the number (B,) of moments at which the box of a drive, larger by a margin [m], overlaps another one so."""
    for b in range(len(steps)):
        steps[b], sizes = 0, boxes.size[boxes.first_size[b] :]
        for t in range(drives.offsets[b], drives.offsets[b + 1]):
            heading, row = drives.heading[t], boxes.first[b] + (t - drives.offsets[b]) * boxes.counts[b]
            box = math.cos(heading), math.sin(heading), drives.box[b, 0] + margin, drives.box[b, 1] + margin
            for n in range(boxes.counts[b]):
                if n == boxes.agents[b] or not boxes.present[row + n]:
                    continue
                x, y = boxes.position[row + n, 0], boxes.position[row + n, 1]
                dx, dy, length, width = x - drives.centre[t, 0, 0], y - drives.centre[t, 0, 1], sizes[n, 0], sizes[n, 1]
                if _touches(dx, dy, box, boxes.heading[row + n], length + margin, width + margin):
                    steps[b] += 1
                    break
