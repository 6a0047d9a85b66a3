"""Kinematic feasibility: Waymax's ``kinematic_infeasibility`` (definition).

The inverse bicycle model gives the acceleration and curvature between consecutive moments. An absolute value above
10.4 m/s² or 0.3 1/m, with a tolerance of 1e-3, is infeasible for a car.
"""

from __future__ import annotations

import math

import numpy as np

from scenarionet_data.arrays.dtypes import Bool, Float64
from scenarionet_data.compiled.decorators import kernel

MAX_ACCELERATION, MAX_CURVATURE = 10.4, 0.3
_TOLERANCE = 1e-3
_SLOW = 0.6  # [m/s] below it the direction of the velocity is not known, nor the curvature


def is_infeasible(velocity: Float64, heading: Float64, dt: float) -> Bool:
    """Return the infeasible steps (T - 1,).

    A step turns from the heading to the direction of the next velocity, which is less noisy than the next heading.

    Args:
        velocity: (T, 2) [m/s].
        heading: (T,) [rad].
        dt: [s].
    """
    infeasible: Bool = np.zeros(max(len(velocity) - 1, 0), np.bool_)
    _mark_infeasible(np.ascontiguousarray(velocity), np.ascontiguousarray(heading), dt, infeasible)
    return infeasible


@kernel(allocates=False)
def _mark_infeasible(velocity: Float64, heading: Float64, dt: float, infeasible: Bool) -> None:
    for t in range(len(infeasible)):
        speed, later = math.hypot(velocity[t, 0], velocity[t, 1]), math.hypot(velocity[t + 1, 0], velocity[t + 1, 1])
        acceleration = (later - speed) / dt
        infeasible[t] = abs(acceleration) > MAX_ACCELERATION + _TOLERANCE
        if not infeasible[t] and speed >= _SLOW and later >= _SLOW:
            direction = heading[t + 1] if later <= _SLOW else math.atan2(velocity[t + 1, 1], velocity[t + 1, 0])
            turn = (direction - heading[t] + math.pi) % (2.0 * math.pi) - math.pi
            way = speed * dt + 0.5 * acceleration * dt**2
            infeasible[t] = abs(turn) > (MAX_CURVATURE + _TOLERANCE) * abs(way)
