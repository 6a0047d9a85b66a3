"""Kinematic bicycle model: no tyre slip, but limited lateral acceleration."""

from __future__ import annotations

import numpy as np

from scenarionet_data.arrays.compiled import device_function, kernel
from scenarionet_data.arrays.dtypes import Float64, Int32
from scenarionet_sim.kernels.log import HEADING, VX, VY, YAW_RATE, X, Y
from scenarionet_sim.kernels.minmax import larger, smaller

MAX_STEER, ACCELERATION, BRAKING, MAX_SPEED, WHEELBASE, GRIP = range(6)
"""Indices into ``limits``, see ``backends.base.Drive`` and ``backends.Kinematic``."""


@kernel
def drive_bicycles(
    agents: Int32, actions: Float64, dt: float, substeps: int, limits: Float64, size: Float64, motion: Float64
) -> None:
    """Advance agents by one control step; axles at equal distance from the centre, front wheels steered.

    Rajamani, Vehicle Dynamics and Control (2012), section 2.2; midpoint rule in the heading.

    Args:
        agents: (A, 2) world and row.
        actions: (A, 2) in [-1, 1] steering (positive left), throttle (negative: brake, down to standstill).
        dt, substeps: Length of the step [s], and number of equal substeps.
        limits: (6,) see above.
        size: (W, N, 3) length, width, height [m].
        motion: (W, N, 7) updated in place.
    """
    for a in range(len(agents)):
        w, n = agents[a, 0], agents[a, 1]
        drive_bicycle(actions[a, 0], actions[a, 1], dt, substeps, limits, size[w, n, 0], motion[w, n])


@device_function
def drive_bicycle(
    steering: float, throttle: float, dt: float, substeps: int, limits: Float64, length: float, row: Float64
) -> None:
    """Advance one agent, the row (7,) of its motion; see :func:`drive_bicycles`."""
    h = dt / substeps
    angle, vx, vy = row[HEADING], row[VX], row[VY]
    speed = np.copysign(np.hypot(vx, vy), np.cos(angle) * vx + np.sin(angle) * vy)
    wheelbase = limits[WHEELBASE] * larger(length, 1.0)
    slope = np.tan(limits[MAX_STEER] * steering)
    slip = np.arctan(slope / 2.0)
    sharpest, turn = slope * np.cos(slip) / wheelbase, 0.0
    for _ in range(substeps):
        if throttle >= 0.0:
            speed = larger(speed, smaller(speed + limits[ACCELERATION] * throttle * h, limits[MAX_SPEED]))
        else:
            speed = np.copysign(larger(abs(speed) + limits[BRAKING] * throttle * h, 0.0), speed)
        curvature = smaller(abs(sharpest), limits[GRIP] / larger(speed * speed, 1e-9))
        turn = speed * np.copysign(curvature, sharpest)
        slip = np.copysign(np.arcsin(smaller(curvature * wheelbase / 2.0, 1.0)), sharpest)
        course = angle + turn * h / 2.0 + slip
        row[X] += speed * np.cos(course) * h
        row[Y] += speed * np.sin(course) * h
        angle += turn * h
    row[VX], row[VY] = speed * np.cos(angle + slip), speed * np.sin(angle + slip)
    row[HEADING] = angle - 2.0 * np.pi * np.floor((angle + np.pi) / (2.0 * np.pi))
    row[YAW_RATE] = turn
