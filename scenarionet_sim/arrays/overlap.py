"""Overlap of boxes: separating-axis test on rectangles in the plane, and height intervals."""

from __future__ import annotations

import numpy as np

from scenarionet_data.arrays.dtypes import Bool, Float64, UInt8
from scenarionet_data.compiled.decorators import device_function
from scenarionet_sim.arrays.boxes import RADIUS, Boxes, rotation
from scenarionet_sim.arrays.boxes import X as BOX_X
from scenarionet_sim.arrays.boxes import Y as BOX_Y
from scenarionet_sim.arrays.log import HEADING, X, Y, Z

Rectangle = tuple[float, float, float, float]
"""Cosine and sine of the heading; length and width [m]."""


@device_function
def is_overlapping(dx: float, dy: float, box: Rectangle, other: Rectangle) -> bool:
    """Return whether two rectangles overlap by more than an edge; (dx, dy) leads from the first centre to the other."""
    (cos, sin, length, width), (other_cos, other_sin, other_length, other_width) = box, other
    c, s = abs(cos * other_cos + sin * other_sin), abs(cos * other_sin - sin * other_cos)
    along, across = abs(cos * dx + sin * dy), abs(cos * dy - sin * dx)
    if 2.0 * along >= length + c * other_length + s * other_width:
        return False
    if 2.0 * across >= width + s * other_length + c * other_width:
        return False
    along, across = abs(other_cos * dx + other_sin * dy), abs(other_cos * dy - other_sin * dx)
    if 2.0 * along >= other_length + c * length + s * width:
        return False
    return 2.0 * across < other_width + s * length + c * width


@device_function
def touch(n: int, objects: tuple[Float64, Float64, UInt8], boxes: Boxes, contacts: Bool) -> np.uint32:
    """Find the objects whose boxes overlap that of one agent, which is present.

    Args:
        n: Row of the agent.
        objects: (N, ...) motion, size and types of those of its world.
        boxes: Boxes of its world.
        contacts: (N,) output; False before.

    Returns:
        The types as bits.
    """
    hits, numbers, (motion, size, object_type) = np.uint32(0), boxes.numbers, objects
    own, length, width = motion[n], size[n, 0], size[n, 1]
    box, radius = (np.cos(own[HEADING]), np.sin(own[HEADING]), length, width), 0.5 * (length + width)
    for b in range(boxes.num_boxes[0]):
        dx, dy, far = numbers[BOX_X, b] - own[X], numbers[BOX_Y, b] - own[Y], numbers[RADIUS, b] + radius
        if dx * dx + dy * dy > far * far:
            continue
        m = boxes.row[b]
        if m == n or 2.0 * abs(motion[m, Z] - own[Z]) > size[m, 2] + size[n, 2]:
            continue
        cos, sin = rotation(b, motion, boxes)
        if is_overlapping(dx, dy, box, (cos, sin, size[m, 0], size[m, 1])):
            contacts[m] = True
            hits |= np.uint32(1) << np.uint32(object_type[m])
    return hits
