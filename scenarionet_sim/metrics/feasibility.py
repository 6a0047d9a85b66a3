"""Whether a motion is one that a car can make: Waymax's ``kinematic_infeasibility``.

The bicycle model is turned round: which acceleration and which curvature lead from one moment to the next? More
than 10.4 m/s² or 0.3 1/m, either way and beyond 1e-3, is more than a car can do.
"""

from __future__ import annotations

import numpy as np

from scenarionet_data.arrays.dtypes import Bool, Float64

MAX_ACCELERATION, MAX_CURVATURE = 10.4, 0.3
_TOLERANCE = 1e-3
_SLOW = 0.6  # [m/s] below it a change of heading says nothing about the wheels


def is_infeasible(speed: Float64, heading: Float64, dt: float) -> Bool:
    """(T - 1,) steps that no car can make.

    Args:
        speed: (T,) along the heading [m/s].
        heading: (T,) [rad].
        dt: [s].
    """
    acceleration = np.diff(speed) / dt
    turn = (np.diff(heading) + np.pi) % (2.0 * np.pi) - np.pi
    way = speed[:-1] * dt + 0.5 * acceleration * dt**2
    is_slow = np.abs(speed[:-1]) < _SLOW
    curvature = np.where(is_slow, 0.0, turn / np.where(is_slow | (way == 0.0), np.inf, way))
    too_hard: Bool = np.abs(acceleration) > MAX_ACCELERATION + _TOLERANCE
    too_sharp: Bool = np.abs(curvature) > MAX_CURVATURE + _TOLERANCE
    return too_hard | too_sharp
