"""Rays in space: a spinning lidar's rings over the ground and over upright boxes."""

from __future__ import annotations

import numpy as np

from scenarionet_data.arrays.compiled import kernel
from scenarionet_data.arrays.dtypes import Bool, Float32, Float64, Int32, UInt8
from scenarionet_sim.kernels.minmax import larger, smaller
from scenarionet_sim.kernels.rays import box_ahead, ray_through_box


@kernel
def spin(
    agents: Int32,
    position: Float64,
    z: Float64,
    heading: Float64,
    size: Float64,
    object_type: UInt8,
    present: Bool,
    is_seen: Bool,
    directions: Float64,
    slopes: Float64,
    mount: float,
    reach: float,
    out: Float32,
) -> None:
    """Ranges of one turn of each agent's lidar, as shares of ``reach``; 1 where nothing is.

    The ground is the plane the agent stands on.

    Args:
        agents: (A, 2) world and row.
        position, z, heading, size, object_type, present: The state of W worlds, see ``State``.
        is_seen: (256,) by ``ObjectType``; code ``GROUND`` (9) is the ground.
        directions: (K, 2) unit vectors of the azimuths 2 pi k / K from straight ahead, counter-clockwise.
        slopes: (R,) tangents of the rings' elevations.
        mount: Height of the lidar over the ground [m].
        reach: Range [m], measured along the ray.
        out: (A, R, K), written.
    """
    count = directions.shape[0]
    enters, leaves = np.empty(count), np.empty(count)
    for a in range(agents.shape[0]):
        w, me = agents[a, 0], agents[a, 1]
        cos_me, sin_me = np.cos(heading[w, me]), np.sin(heading[w, me])
        eye = z[w, me] - 0.5 * size[w, me, 2] + mount
        for ring in range(slopes.shape[0]):
            ground = 1.0
            if is_seen[9] and slopes[ring] < 0.0:
                ground = smaller(-mount / slopes[ring] * np.sqrt(1.0 + slopes[ring] ** 2) / reach, 1.0)
            for k in range(count):
                out[a, ring, k] = ground
        for n in range(position.shape[1]):
            if n == me or not present[w, n] or not is_seen[object_type[w, n]]:
                continue
            dx, dy = position[w, n, 0] - position[w, me, 0], position[w, n, 1] - position[w, me, 1]
            half_x, half_y, turn = 0.5 * size[w, n, 0], 0.5 * size[w, n, 1], heading[w, n] - heading[w, me]
            first, last, x, y, cos, sin = box_ahead(dx, dy, cos_me, sin_me, turn, half_x, half_y, reach, count)
            for ray in range(first, last + 1):
                k = ray + count if ray < 0 else ray
                forward = cos * directions[k, 0] + sin * directions[k, 1]
                left = cos * directions[k, 1] - sin * directions[k, 0]
                enters[ray - first], leaves[ray - first] = ray_through_box(x, y, forward, left, half_x, half_y)
            bottom, top = z[w, n] - 0.5 * size[w, n, 2] - eye, z[w, n] + 0.5 * size[w, n, 2] - eye
            for ring in range(slopes.shape[0]):
                slope = slopes[ring]
                stretch = np.sqrt(1.0 + slope * slope) / reach
                low, high = 0.0, np.inf  # how far away, over the ground, the ring is as high as the box
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
