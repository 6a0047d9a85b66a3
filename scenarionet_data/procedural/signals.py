"""Traffic lights: two phases per junction, separated by yellow and all-red."""

from __future__ import annotations

import numpy as np

from scenarionet_data.arrays.dtypes import Int32
from scenarionet_data.procedural.right_of_way import CAUTION, GO, STOP

YELLOW = 3.0  # [s]
ALL_RED = 2.0  # [s]
GREEN = (9.0, 16.0)  # [s] shortest and longest


def make_lights(rows: list[tuple[int, int]], steps: int, dt: float, rng: np.random.Generator) -> Int32:
    """Return (rows, steps) GO, CAUTION or STOP for the (junction, axis) of each row."""
    lights = np.full((max(len(rows), 1), steps), STOP, dtype=np.int32)
    for junction in sorted({junction for junction, _ in rows}):
        greens = rng.uniform(*GREEN, size=2)
        starts = np.array([0.0, greens[0] + YELLOW + ALL_RED])
        cycle = starts[1] + greens[1] + YELLOW + ALL_RED
        offset = rng.uniform(0.0, cycle)
        for axis in (0, 1):
            if (junction, axis) in rows:
                since = (np.arange(steps) * dt + offset - starts[axis]) % cycle
                row = lights[rows.index((junction, axis))]
                row[since < greens[axis] + YELLOW] = CAUTION
                row[since < greens[axis]] = GO
    return lights
