"""Kinematic feasibility: Waymax's ``kinematic_infeasibility`` (definition).

The inverse bicycle model gives the acceleration and curvature between consecutive moments. An absolute value above
10.4 m/s² or 0.3 1/m, with a tolerance of 1e-3, is infeasible for a car.
"""

from __future__ import annotations

import numpy as np

from scenarionet_data.arrays.dtypes import Bool, Float64

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
    speed = np.hypot(*velocity.T)
    acceleration = np.diff(speed) / dt
    is_slow = speed <= _SLOW
    direction = np.where(is_slow, heading, np.arctan2(velocity[:, 1], velocity[:, 0]))
    turn = (direction[1:] - heading[:-1] + np.pi) % (2.0 * np.pi) - np.pi
    way = speed[:-1] * dt + 0.5 * acceleration * dt**2
    stands = (speed[:-1] < _SLOW) | (speed[1:] < _SLOW)
    curvature = np.where(stands, 0.0, turn / np.where(stands, np.inf, way))
    too_hard: Bool = np.abs(acceleration) > MAX_ACCELERATION + _TOLERANCE
    too_sharp: Bool = np.abs(curvature) > MAX_CURVATURE + _TOLERANCE
    return too_hard | too_sharp
