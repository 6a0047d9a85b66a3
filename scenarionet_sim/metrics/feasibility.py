"""Kinematic feasibility: Waymax's ``kinematic_infeasibility``.

The inverse bicycle model gives the acceleration and curvature between consecutive moments. An absolute value above
10.4 m/s² or 0.3 1/m, with a tolerance of 1e-3, is infeasible for a car.
"""

from __future__ import annotations

import numpy as np

from scenarionet_data.arrays.dtypes import Bool, Float64

MAX_ACCELERATION, MAX_CURVATURE = 10.4, 0.3
_TOLERANCE = 1e-3
_SLOW = 0.6  # [m/s] below it a change of heading does not determine the curvature


def is_infeasible(speed: Float64, heading: Float64, dt: float) -> Bool:
    """Return the infeasible steps (T - 1,).

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
