"""Kinematic feasibility: Waymax's ``kinematic_infeasibility`` (definition).

The inverse bicycle model gives the acceleration and curvature between consecutive moments. An absolute value above
10.4 m/s² or 0.3 1/m, with a tolerance of 1e-3, is infeasible for a car.
"""

from __future__ import annotations

import math

import numpy as np

from scenarionet_data.arrays.dtypes import Bool, Float64, Int64
from scenarionet_data.compiled.decorators import device_function, kernel
from scenarionet_sim.metrics.drive import Drives, MovingBoxes

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
        infeasible[t] = _is_infeasible(velocity[t], velocity[t + 1], heading[t], heading[t + 1], dt)


@kernel(allocates=False)
def count_infeasible(drives: Drives, boxes: MovingBoxes, dt: Float64, steps: Int64) -> None:
    """Write the number (B,) of infeasible steps of drives, whose steps take some times (B,) [s]."""
    for b in range(len(steps)):
        row, steps[b] = boxes.first[b] + boxes.agents[b], 0
        for t in range(drives.offsets[b], drives.offsets[b + 1] - 1):
            velocity, later = boxes.velocity[row], boxes.velocity[row + boxes.counts[b]]
            steps[b] += _is_infeasible(velocity, later, drives.heading[t], drives.heading[t + 1], dt[b])
            row += boxes.counts[b]


@device_function
def _is_infeasible(velocity: Float64, next_velocity: Float64, heading: float, next_heading: float, dt: float) -> bool:
    speed, later = math.hypot(velocity[0], velocity[1]), math.hypot(next_velocity[0], next_velocity[1])
    acceleration = (later - speed) / dt
    if abs(acceleration) > MAX_ACCELERATION + _TOLERANCE:
        return True
    if speed < _SLOW or later < _SLOW:
        return False
    direction = next_heading if later <= _SLOW else math.atan2(next_velocity[1], next_velocity[0])
    turn = (direction - heading + math.pi) % (2.0 * math.pi) - math.pi
    way = speed * dt + 0.5 * acceleration * dt**2
    return abs(turn) > (MAX_CURVATURE + _TOLERANCE) * abs(way)
