"""Which boxes overlap: the separating-axis test on rectangles in the plane, and heights."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from scenarionet_data.arrays.compiled import device_function, kernel
from scenarionet_data.arrays.dtypes import Bool, Float64, Int32, UInt8


@device_function
def is_overlapping(
    dx: float, dy: float, cos: float, sin: float, length: float, width: float,
    other_cos: float, other_sin: float, other_length: float, other_width: float,
) -> bool:  # fmt: skip
    """Whether two rectangles share more than their edge; the other's middle is at (dx, dy) from the first's."""
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


@kernel
def find_contacts(
    agents: Int32,
    position: Float64,
    heading: Float64,
    z: Float64,
    size: Float64,
    object_type: UInt8,
    present: Bool,
    contacts: Bool,
    hits: npt.NDArray[np.uint32],
) -> None:
    """What each agent's box overlaps.

    Args:
        agents: (A, 2) world and row; an agent that is not present touches nothing.
        position, heading, z, size, object_type, present: See ``State``.
        contacts: (A, N) written.
        hits: (A,) written: bit k is set when an object of type k is touched.
    """
    for a in range(len(agents)):
        w, n = agents[a, 0], agents[a, 1]
        hits[a] = 0
        for m in range(present.shape[1]):
            contacts[a, m] = False
        if not present[w, n]:
            continue
        x, y, length, width = position[w, n, 0], position[w, n, 1], size[w, n, 0], size[w, n, 1]
        cos, sin, reach = np.cos(heading[w, n]), np.sin(heading[w, n]), length + width
        for m in range(present.shape[1]):
            dx, dy = position[w, m, 0] - x, position[w, m, 1] - y
            far = reach + size[w, m, 0] + size[w, m, 1]  # twice a circle's radius is at most length + width
            if not present[w, m] or m == n or 4.0 * (dx * dx + dy * dy) > far * far:
                continue
            if 2.0 * abs(z[w, m] - z[w, n]) > size[w, m, 2] + size[w, n, 2]:
                continue
            other_cos, other_sin = np.cos(heading[w, m]), np.sin(heading[w, m])
            if is_overlapping(dx, dy, cos, sin, length, width, other_cos, other_sin, size[w, m, 0], size[w, m, 1]):
                contacts[a, m] = True
                hits[a] |= np.uint32(1) << np.uint32(object_type[w, m])
