"""Effect of engine, brakes and tyres on a vehicle's velocity in one physics step.

The tyres of each axle cancel the velocity across the wheels as far as friction allows, as in Bullet's raycast
vehicle: with grip a vehicle follows the arc of its front wheels, without it slides. Both axles are at the same
distance from the centre of mass and carry half of the load each; all quantities are per unit of mass.
"""

from __future__ import annotations

import math

from scenarionet_data.arrays.dtypes import Float64
from scenarionet_data.compiled.decorators import device_function, kernel
from scenarionet_sim.arrays.minmax import larger, smaller

Vehicle = tuple[float, float, float, float, float, float]
"""Angle of the front wheels at steering 1 [rad]; acceleration of engine, brakes and friction limit [m/s²]; maximum
speed of the engine [m/s]; wheelbase as a share of the length."""


@kernel
def apply_tyres(motion: Float64, size: Float64, actions: Float64, vehicle: Vehicle, step: float) -> None:
    """Apply the wheels' impulses of one step to the velocities, in place.

    Args:
        motion: (A, 6) x, y, heading [rad], velocity along x and y [m/s], yaw rate [rad/s]; the last three change.
        size: (A, 3) [m].
        actions: (A, 2) steering and throttle in [-1, 1].
        vehicle: Capabilities of every agent.
        step: [s].
    """
    max_steer, acceleration, braking, friction, max_speed, wheelbase = vehicle
    grip = friction * step
    for a in range(len(motion)):
        cos, sin = math.cos(motion[a, 2]), math.sin(motion[a, 2])
        forward = cos * motion[a, 3] + sin * motion[a, 4]
        left = cos * motion[a, 4] - sin * motion[a, 3]
        throttle = actions[a, 1]
        if throttle < 0.0:  # at most to standstill
            wanted = -math.copysign(smaller(-throttle * braking * step, abs(forward)), forward)
        else:  # up to the maximum speed
            wanted = smaller(throttle * acceleration * step, larger(0.0, max_speed - forward))
        change = larger(-grip, smaller(grip, wanted))
        axle = 0.5 * change, 0.5 * math.sqrt(grip * grip - change * change)
        length, width = size[a, 0], size[a, 1]
        frame = 0.5 * wheelbase * length, (length * length + width * width) / 12.0
        forward, left, motion[a, 5] = _roll(forward, left, motion[a, 5], actions[a, 0] * max_steer, frame, axle)
        motion[a, 3] = cos * forward - sin * left
        motion[a, 4] = sin * forward + cos * left


@device_function
def _roll(
    forward: float, left: float, yaw_rate: float, steer: float, frame: tuple[float, float], axle: tuple[float, float]
) -> tuple[float, float, float]:
    """Return velocity and yaw rate after the impulses of both axles along and across their wheels.

    The lateral impulses f and r solve [[a, b], [b, d]] (f, r) = -(slip_f, slip_r), which leaves no lateral velocity
    at either axle; an impulse beyond the friction limit is clipped and the other one solved again.

    Args:
        forward, left, yaw_rate: Velocity in the vehicle's frame.
        steer: Angle of the front wheels.
        frame: Distance from centre to axle, and squared radius of gyration.
        axle: Longitudinal impulse of each axle, and its largest lateral one, per unit of mass.
    """
    (arm, gyration), (along, grip) = frame, axle
    cos, sin = math.cos(steer), math.sin(steer)
    lever = arm * cos
    forward, left, yaw_rate = forward + along * (1.0 + cos), left + along * sin, yaw_rate + arm * along * sin / gyration
    slip_f = cos * (left + arm * yaw_rate) - sin * forward
    slip_r = left - arm * yaw_rate
    a, b, d = 1.0 + lever * lever / gyration, cos - lever * arm / gyration, 1.0 + arm * arm / gyration
    f, r = (b * slip_r - d * slip_f) / (a * d - b * b), (b * slip_f - a * slip_r) / (a * d - b * b)
    if abs(f) > larger(grip, abs(r)):
        f = larger(-grip, smaller(grip, f))
        r = larger(-grip, smaller(grip, -(slip_r + b * f) / d))
    elif abs(r) > grip:
        r = larger(-grip, smaller(grip, r))
        f = larger(-grip, smaller(grip, -(slip_f + b * r) / a))
    return forward - sin * f, left + cos * f + r, yaw_rate + (lever * f - arm * r) / gyration
