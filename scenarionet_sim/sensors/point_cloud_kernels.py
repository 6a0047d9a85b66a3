"""Ray casting in space: the rings of a spinning lidar over the ground and upright boxes."""

from __future__ import annotations

import numpy as np

from scenarionet_data.arrays.dtypes import Bool, Float32, Float64, Int32
from scenarionet_data.compiled.decorators import kernel
from scenarionet_sim.arrays.log import HEADING, X, Y, Z
from scenarionet_sim.arrays.minmax import larger, smaller
from scenarionet_sim.roads.ray_kernels import ray_through_box


@kernel
def spin(
    agents: Int32,
    motion: Float64,
    size: Float64,
    is_visible: Bool,
    directions: Float64,
    rings: Float64,
    lidar: tuple[float, float],
    out: Float32,
) -> None:
    """Compute the ranges of one revolution of each agent's lidar, divided by the reach; 1 without a hit.

    Args:
        agents: (A, 2) world and row.
        motion, size: See ``State``.
        is_visible: (W, N) objects to detect.
        directions: (K, 2) unit vectors of the azimuths 2 pi k / K from straight ahead, counter-clockwise.
        rings: (R, 2) tangent of each ring's elevation, and its range on the ground divided by the reach.
        lidar: Height over the ground, and reach along the ray [m].
        out: (A, R, K) output.
    """
    count, (mount, reach) = directions.shape[0], lidar
    per_radian = count / (2.0 * np.pi)
    enters, leaves = np.empty(count), np.empty(count)
    for a in range(agents.shape[0]):
        w, own = agents[a, 0], agents[a, 1]
        me = motion[w, own]
        cos_me, sin_me = np.cos(me[HEADING]), np.sin(me[HEADING])
        eye = me[Z] - 0.5 * size[w, own, 2] + mount
        for ring in range(rings.shape[0]):
            for k in range(count):
                out[a, ring, k] = rings[ring, 1]
        for n in range(motion.shape[1]):
            if n == own or not is_visible[w, n]:
                continue
            dx, dy, turn = motion[w, n, X] - me[X], motion[w, n, Y] - me[Y], motion[w, n, HEADING] - me[HEADING]
            half_x, half_y = 0.5 * size[w, n, 0], 0.5 * size[w, n, 1]
            radius = np.sqrt(half_x * half_x + half_y * half_y)
            if dx * dx + dy * dy >= (reach + radius) * (reach + radius):
                continue
            ahead, aside = cos_me * dx + sin_me * dy, cos_me * dy - sin_me * dx
            first, last, apart = 0, count - 1, np.sqrt(ahead * ahead + aside * aside)
            if apart > radius:  # those that may meet the circle around the box; -1 is the last ray
                middle, half = np.arctan2(aside, ahead), np.arcsin(radius / apart)
                first = int(np.ceil((middle - half) * per_radian - 1e-9))
                last = smaller(int(np.floor((middle + half) * per_radian + 1e-9)), first + count - 1)
            cos, sin = np.cos(turn), np.sin(turn)
            x, y = -(cos * ahead + sin * aside), -(cos * aside - sin * ahead)  # the agent in the frame of the box
            for ray in range(first, last + 1):
                k = ray + count if ray < 0 else ray
                forward = cos * directions[k, 0] + sin * directions[k, 1]
                left = cos * directions[k, 1] - sin * directions[k, 0]
                enters[ray - first], leaves[ray - first] = ray_through_box(x, y, forward, left, half_x, half_y)
            bottom, top = motion[w, n, Z] - 0.5 * size[w, n, 2] - eye, motion[w, n, Z] + 0.5 * size[w, n, 2] - eye
            for ring in range(rings.shape[0]):
                slope = rings[ring, 0]
                stretch = np.sqrt(1.0 + slope * slope) / reach
                low, high = 0.0, np.inf  # horizontal distances at which the ring is at the height of the box
                if slope > 0.0:
                    low, high = larger(bottom / slope, 0.0), top / slope
                elif slope < 0.0:
                    low, high = larger(top / slope, 0.0), bottom / slope
                elif bottom > 0.0 or top < 0.0:
                    continue
                for ray in range(first, last + 1):
                    along = larger(enters[ray - first], low)
                    k = ray + count if ray < 0 else ray
                    if along <= smaller(leaves[ray - first], high) and along * stretch < out[a, ring, k]:
                        out[a, ring, k] = along * stretch
