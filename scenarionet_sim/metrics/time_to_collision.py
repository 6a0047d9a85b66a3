"""Time to collision: when boxes would overlap at constant velocity, as nuPlan's ``time_to_collision``.

The horizon is 0.1 s to 2.9 s in steps of 0.1 s, at the current velocity and heading. Objects within 30 degrees of the
vehicle's heading, seen from its rear axle, count; between lanes all objects within 150 degrees. Objects that have
been touched before do not count. A standing vehicle (at most 5 mm/s) has no time to collision.
"""

from __future__ import annotations

import math

import numpy as np

from scenarionet_data.arrays.compiled import kernel
from scenarionet_data.arrays.dtypes import Bool, Float64
from scenarionet_sim.kernels.overlap import is_overlapping

STEP, HORIZON, BOUND = 0.1, 3.0, 0.95
"""Step and horizon, and nuPlan's lower bound [s]."""

_AHEAD, _BEHIND = math.cos(math.radians(30.0)), math.cos(math.radians(150.0))
_STANDING = 5e-3


@kernel
def time_to_collision(
    position: Float64, heading: Float64, velocity: Float64, size: Float64, present: Bool, touched: Bool,
    between_lanes: Bool, ego: int, rear: float,
) -> Float64:  # fmt: skip
    """Return the time to the next collision at every moment.

    Args:
        position: (T, N, 2) [m].
        heading: (T, N) [rad].
        velocity: (T, N, 2) [m/s].
        size: (N, 3) [m].
        present: (T, N).
        touched: (T, N) objects that the vehicle touches or has touched.
        between_lanes: (T,) vehicle is in more than one lane, or in an intersection.
        ego: Row of the vehicle.
        rear: Distance from its centre to its rear axle [m].

    Returns:
        (T,) [s]; infinite without a collision.
    """
    soonest = np.full(len(position), np.inf)
    length, width, num_steps = size[ego, 0], size[ego, 1], round(HORIZON / STEP)
    for t in range(len(position)):
        vx, vy = velocity[t, ego, 0], velocity[t, ego, 1]
        if math.hypot(vx, vy) <= _STANDING:
            continue
        cos, sin = math.cos(heading[t, ego]), math.sin(heading[t, ego])
        for n in range(position.shape[1]):
            if n == ego or not present[t, n] or touched[t, n]:
                continue
            dx, dy = position[t, n, 0] - position[t, ego, 0], position[t, n, 1] - position[t, ego, 1]
            x, y = dx + rear * cos, dy + rear * sin
            along = (cos * x + sin * y) / max(math.hypot(x, y), 1e-9)
            if along < (_BEHIND if between_lanes[t] else _AHEAD):
                continue
            rx, ry = velocity[t, n, 0] - vx, velocity[t, n, 1] - vy
            reach = 0.5 * (math.hypot(length, width) + math.hypot(size[n, 0], size[n, 1]))
            if math.hypot(dx, dy) - math.hypot(rx, ry) * HORIZON > reach:
                continue
            c, s = math.cos(heading[t, n]), math.sin(heading[t, n])
            for k in range(1, num_steps):
                ahead = k * STEP
                if ahead >= soonest[t]:
                    break
                if is_overlapping(
                    dx + rx * ahead, dy + ry * ahead, cos, sin, length, width, c, s, size[n, 0], size[n, 1]
                ):
                    soonest[t] = ahead
                    break
    return soonest
