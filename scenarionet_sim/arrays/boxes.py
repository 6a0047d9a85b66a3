"""The boxes of a world in sequence, written once for everything that looks at them."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from scenarionet_data.arrays.dtypes import Bool, Float64, Int32, Int64
from scenarionet_data.compiled.decorators import device_function
from scenarionet_sim.arrays.log import HEADING
from scenarionet_sim.arrays.log import X as MOTION_X
from scenarionet_sim.arrays.log import Y as MOTION_Y

X, Y, COS, SIN, HALF_LENGTH, HALF_WIDTH, RADIUS = range(7)
"""Rows of ``Boxes.numbers``."""


class Boxes(NamedTuple):
    """Memory for the present boxes of one world, in the order of their rows.

    Attributes:
        numbers: (7, N) centre [m]; cosine and sine of the heading, NaN until :func:`rotation` is called; half of
            length and width [m]; radius of the circumscribed circle [m].
        row: (N,) row of each in the world.
        num_boxes: (1,) their number.
    """

    numbers: Float64
    row: Int32
    num_boxes: Int64

    @classmethod
    def of(cls, num_objects: int) -> Boxes:
        """Allocate the memory for worlds of up to so many objects."""
        return cls(np.empty((7, num_objects)), np.empty(num_objects, np.int32), np.zeros(1, np.int64))


@device_function
def write_boxes(count: int, motion: Float64, size: Float64, present: Bool, boxes: Boxes) -> None:
    """Write the present ones of the first ``count`` objects (N, ...) of a world."""
    numbers, b = boxes.numbers, 0
    for n in range(count):
        if present[n]:
            half_length, half_width = size[n, 0] / 2.0, size[n, 1] / 2.0
            boxes.row[b], numbers[X, b], numbers[Y, b] = n, motion[n, MOTION_X], motion[n, MOTION_Y]
            numbers[COS, b] = np.nan
            numbers[HALF_LENGTH, b], numbers[HALF_WIDTH, b] = half_length, half_width
            numbers[RADIUS, b] = np.sqrt(half_length * half_length + half_width * half_width)
            b += 1
    boxes.num_boxes[0] = b


@device_function
def rotation(b: int, motion: Float64, boxes: Boxes) -> tuple[float, float]:
    """Return the cosine and sine of a box's heading, which most boxes are too far away to need."""
    numbers = boxes.numbers
    if np.isnan(numbers[COS, b]):
        heading = motion[boxes.row[b], HEADING]
        numbers[COS, b], numbers[SIN, b] = np.cos(heading), np.sin(heading)
    return numbers[COS, b], numbers[SIN, b]
