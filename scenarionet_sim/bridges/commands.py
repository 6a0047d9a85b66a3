"""What driving stacks answer, whatever they speak, and what that tells the vehicle to do."""

from __future__ import annotations

import math
from dataclasses import dataclass

from scenarionet_data.errors import BadParameter
from scenarionet_sim.backends.base import Drive
from scenarionet_sim.planners.base import Action, Trajectory
from scenarionet_sim.planners.view import View


@dataclass(frozen=True)
class Steer:
    """Front wheels and a speed.

    Attributes:
        steering: Angle of the front wheels, positive to the left [rad].
        speed: [m/s].
        acceleration: To reach the speed with [m/s²]; 0: as quickly as the vehicle can.
    """

    steering: float
    speed: float
    acceleration: float = 0.0


@dataclass(frozen=True)
class Twist:
    """A speed [m/s] and a yaw rate [rad/s]."""

    speed: float
    yaw_rate: float


@dataclass(frozen=True)
class Push:
    """Front wheels and an acceleration.

    Attributes:
        steering: Angle of the front wheels, positive to the left [rad].
        acceleration: Along the heading [m/s²].
    """

    steering: float
    acceleration: float


Command = Steer | Twist | Push | Trajectory
"""One of these; the times of a trajectory count from the moment that it answers."""


def drive(command: Command, view: View, age: float = 0.0) -> Action | Trajectory:
    """Return what a command tells the vehicle to do.

    Args:
        command: The command.
        view: The moment.
        age: Time since the moment that the command answers [s].

    Raises:
        BadParameter: A number is not finite, or a plan has ended.
    """
    if isinstance(command, Trajectory):
        if not age:
            return command
        times = command.times - age
        if times[-1] < view.dt - 1e-9:
            raise BadParameter(
                f"the stack's latest plan is {age:g} s old and ends after {command.times[-1]:g} s; send plans more "
                "often, or longer ones"
            )
        is_left = times > 1e-9  # the rest begins where the vehicle is
        return Trajectory(command.poses[is_left], times[is_left])
    vehicle = Drive()
    steering, limit = 0.0, math.inf
    if isinstance(command, Push):
        steering, wanted = command.steering, command.acceleration
    else:
        wanted = (command.speed - view.ego.speed) / view.dt
        if isinstance(command, Steer):
            steering, limit = command.steering, abs(command.acceleration) or math.inf
        elif command.speed:
            steering = math.atan(vehicle.wheelbase * view.ego.length * command.yaw_rate / command.speed)
    if not (math.isfinite(wanted) and math.isfinite(steering) and not math.isnan(limit)):
        raise BadParameter(f"the stack asks for {command}; expected finite numbers")
    wanted = min(max(wanted, -limit), limit)
    throttle = wanted / (vehicle.acceleration if wanted > 0.0 else vehicle.braking)
    return [min(max(steering / vehicle.max_steer, -1.0), 1.0), min(max(throttle, -1.0), 1.0)]
