"""Kinematic bicycle model: no tyre slip up to the friction circle, beyond it the front wheels slide."""

from __future__ import annotations

import numpy as np

from scenarionet_data.arrays.dtypes import Float64, Int32
from scenarionet_data.compiled.decorators import device_function, kernel
from scenarionet_sim.arrays.log import HEADING, VX, VY, YAW_RATE, X, Y
from scenarionet_sim.arrays.minmax import larger, smaller

(
    MAX_STEER, ACCELERATION, BRAKING, MAX_SPEED, WHEELBASE, GRIP, STEER_RATE, DRAG, ROLLING, REVERSE, ANGLE,
) = range(11)  # fmt: skip
"""Columns of ``vehicles``, see ``backends.base.Drive`` and ``backends.Kinematic``; the last is the current angle of the
front wheels [rad], which changes."""

NUM_COLUMNS = 11


@kernel
def drive_bicycles(
    agents: Int32, actions: Float64, dt: float, substeps: int, vehicles: Float64, size: Float64, motion: Float64
) -> None:
    """Advance agents by one control step; axles at equal distance from the centre, front wheels steered.

    Rajamani, Vehicle Dynamics and Control (2012), section 2.2; midpoint rule in the heading. What engine, brakes and
    the change of the course, which is heading and slip angle together, ask of the tyres is cut to the friction circle;
    where the bend is wider than the front wheels point, they slide, and the part of their force against the motion
    slows the vehicle down. Air drag grows with the square
    of the speed, and rolling resistance and engine brake are constant.

    Args:
        agents: (A, 2) world and row.
        actions: (A, 2) in [-1, 1] steering (positive left), throttle (negative: brake, down to standstill, and from
            there backwards, for a vehicle with a reverse gear).
        dt, substeps: Length of the step [s], and number of equal substeps.
        vehicles: (W, N, NUM_COLUMNS) see above; the current angles are written.
        size: (W, N, 3) length, width, height [m].
        motion: (W, N, 7) updated in place.
    """
    for a in range(len(agents)):
        w, n = agents[a, 0], agents[a, 1]
        drive_bicycle(actions[a, 0], actions[a, 1], dt, substeps, vehicles[w, n], size[w, n, 0], motion[w, n])


@device_function
def drive_bicycle(
    steering: float, throttle: float, dt: float, substeps: int, vehicle: Float64, length: float, row: Float64
) -> None:
    """Advance one agent, the row (7,) of its motion; see :func:`drive_bicycles`."""
    h = dt / substeps
    heading, vx, vy = row[HEADING], row[VX], row[VY]
    forward, left = np.cos(heading) * vx + np.sin(heading) * vy, np.cos(heading) * vy - np.sin(heading) * vx
    speed = np.copysign(np.hypot(vx, vy), forward)
    slip = np.arctan(left / forward) if forward != 0.0 else 0.0
    wheelbase, grip = vehicle[WHEELBASE] * larger(length, 1.0), vehicle[GRIP]
    wanted, reach = vehicle[MAX_STEER] * steering, vehicle[STEER_RATE] * h
    angle, sharpest, steered, turn = np.nan, 0.0, 0.0, 0.0
    for _ in range(substeps):
        steer = smaller(larger(wanted, vehicle[ANGLE] - reach), vehicle[ANGLE] + reach)
        if steer != angle:
            angle, slope = steer, np.tan(steer)
            steered = np.arctan(slope / 2.0)
            vehicle[ANGLE], sharpest = steer, slope * np.cos(steered) / wheelbase
        push = _push(speed, throttle, h, vehicle)
        swing = speed * sharpest * h + steered - slip  # change of the course that the wheels ask for [rad]
        bend = abs(swing * speed) / h
        asked, curvature, before, slip = np.hypot(push, bend), sharpest, slip, steered
        if asked > grip:
            share = grip / asked
            slip = (before + share * swing) / (1.0 + 2.0 * speed * h / wheelbase)
            curvature = 2.0 * np.sin(slip) / wheelbase
            sliding = larger(abs(angle) - abs(np.arctan(curvature * wheelbase)), 0.0)
            push = share * push - np.copysign(0.5 * share * bend * np.sin(sliding), speed)
        resisting = smaller((vehicle[DRAG] * speed * speed + vehicle[ROLLING]) * h, abs(speed))
        speed += push * h - np.copysign(resisting, speed)
        turn = speed * curvature
        course = heading + turn * h / 2.0 + slip
        row[X] += speed * np.cos(course) * h
        row[Y] += speed * np.sin(course) * h
        heading += turn * h
    row[VX], row[VY] = speed * np.cos(heading + slip), speed * np.sin(heading + slip)
    row[HEADING] = heading - 2.0 * np.pi * np.floor((heading + np.pi) / (2.0 * np.pi))
    row[YAW_RATE] = turn


@device_function
def _push(speed: float, throttle: float, h: float, vehicle: Float64) -> float:
    """Return the acceleration that engine or brakes ask for [m/s²]: up to a top speed, or down to standstill."""
    if throttle >= 0.0:
        push = larger(smaller(vehicle[ACCELERATION] * throttle, (vehicle[MAX_SPEED] - speed) / h), 0.0)
    elif speed <= 0.0 and vehicle[REVERSE] > 0.0:
        push = smaller(larger(vehicle[ACCELERATION] * throttle, (-vehicle[REVERSE] - speed) / h), 0.0)
    else:
        push = -np.copysign(smaller(-vehicle[BRAKING] * throttle, abs(speed) / h), speed)
    return float(push)
