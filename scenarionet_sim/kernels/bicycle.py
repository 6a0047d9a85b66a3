"""Vehicles as bicycles: no slip of the tyres, but no more sideways acceleration than they hold."""

from __future__ import annotations

import numpy as np

from scenarionet_data.arrays.compiled import kernel
from scenarionet_data.arrays.dtypes import Float64, Int32
from scenarionet_sim.kernels.minmax import larger, smaller

MAX_STEER, ACCELERATION, BRAKING, MAX_SPEED, WHEELBASE, GRIP = range(6)
"""Places of a vehicle's numbers in ``limits``, see ``backends.base.Drive`` and ``backends.Kinematic``."""


@kernel
def drive_bicycles(
    agents: Int32,
    actions: Float64,
    dt: float,
    substeps: int,
    limits: Float64,
    size: Float64,
    position: Float64,
    heading: Float64,
    velocity: Float64,
    yaw_rate: Float64,
) -> None:
    """One control step of the kinematic bicycle whose axles are as far from its middle, front wheels steered.

    Rajamani, Vehicle Dynamics and Control (2012), section 2.2; midpoint rule in the heading.

    Args:
        agents: (A, 2) world and row.
        actions: (A, 2) in [-1, 1] steering (left is positive), throttle (negative: brake, down to a standstill).
        dt, substeps: [s], and in how many equal parts.
        limits: (6,) what a vehicle is capable of.
        size, position, heading, velocity, yaw_rate: See ``State``; all but the size are written.
    """
    h = dt / substeps
    for a in range(len(agents)):
        w, n = agents[a, 0], agents[a, 1]
        angle, vx, vy = heading[w, n], velocity[w, n, 0], velocity[w, n, 1]
        speed = np.copysign(np.hypot(vx, vy), np.cos(angle) * vx + np.sin(angle) * vy)
        wheelbase = limits[WHEELBASE] * larger(size[w, n, 0], 1.0)
        slope = np.tan(limits[MAX_STEER] * actions[a, 0])
        slip = np.arctan(slope / 2.0)
        sharpest, throttle, turn = slope * np.cos(slip) / wheelbase, actions[a, 1], 0.0
        for _ in range(substeps):
            if throttle >= 0.0:
                speed = larger(speed, smaller(speed + limits[ACCELERATION] * throttle * h, limits[MAX_SPEED]))
            else:
                speed = np.copysign(larger(abs(speed) + limits[BRAKING] * throttle * h, 0.0), speed)
            bend = smaller(abs(sharpest), limits[GRIP] / larger(speed * speed, 1e-9))
            turn = speed * np.copysign(bend, sharpest)
            slip = np.copysign(np.arcsin(smaller(bend * wheelbase / 2.0, 1.0)), sharpest)
            course = angle + turn * h / 2.0 + slip
            position[w, n, 0] += speed * np.cos(course) * h
            position[w, n, 1] += speed * np.sin(course) * h
            angle += turn * h
        velocity[w, n, 0], velocity[w, n, 1] = speed * np.cos(angle + slip), speed * np.sin(angle + slip)
        heading[w, n] = angle - 2.0 * np.pi * np.floor((angle + np.pi) / (2.0 * np.pi))
        yaw_rate[w, n] = turn
