"""Trackers: they move a vehicle along the trajectory of a planner."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache
from typing import Protocol, runtime_checkable

import numpy as np

from scenarionet_data.arrays.dtypes import Array, Float64
from scenarionet_data.arrays.geometry import wrap_angle
from scenarionet_data.scenario.settings import Count, Positive, check_settings
from scenarionet_sim.planners.base import Trajectory


@dataclass
class TrackedVehicle:
    """A vehicle that follows trajectories.

    Attributes:
        x, y, heading: Centre of its box [m], [rad], in the scenario's frame.
        speed: Along the heading [m/s].
        yaw_rate: [rad/s].
        length: [m].
        velocity: (vx, vy) of the centre [m/s].
        acceleration: Along the heading [m/s²], as the engine and the brakes do it.
        steering: Angle of the front wheels [rad].
    """

    x: float
    y: float
    heading: float
    speed: float
    yaw_rate: float
    length: float
    velocity: tuple[float, float] = (0.0, 0.0)
    acceleration: float = 0.0
    steering: float = 0.0


@runtime_checkable
class Tracker(Protocol):
    """Moves vehicles along trajectories; hashable and picklable."""

    def wheelbase(self, length: float) -> float:
        """Return the distance between the axles of a vehicle [m]."""
        ...

    def follow(self, vehicle: TrackedVehicle, trajectory: Trajectory, dt: float) -> None:
        """Advance a vehicle by one step of ``dt`` [s], in place.

        Args:
            vehicle: The vehicle.
            trajectory: In the scenario's frame.
            dt: [s].
        """
        ...


@lru_cache(maxsize=64)
def _squared_differences(count: int, order: int) -> Float64:
    """The matrix (count, count) of the sum of the squared differences of an order."""
    differences = np.diff(np.eye(count), n=order, axis=0)
    return np.asarray(differences.T @ differences, np.float64)


_WHEELBASE = 0.6
"""Wheelbase as a share of the length: 3.089 m of 5.176 m in nuPlan's vehicle."""


@dataclass(frozen=True)
class PerfectTracking:
    """The vehicle is where the trajectory says, whether or not a vehicle could be."""

    def wheelbase(self, length: float) -> float:
        """Return the distance between the axles of a vehicle [m]."""
        return _WHEELBASE * length

    def follow(self, vehicle: TrackedVehicle, trajectory: Trajectory, dt: float) -> None:
        """Put a vehicle on the trajectory; its velocity is that of the trajectory over the step and the next one."""
        before = np.array([vehicle.x, vehicle.y, vehicle.heading])
        there, later = trajectory.at(np.array([dt, 2.0 * dt]))
        span = 2.0 * dt if trajectory.times[-1] >= 2.0 * dt - 1e-9 else dt
        moved = (later if span > dt else there) - before
        speed = math.hypot(moved[0], moved[1]) / span
        vehicle.x, vehicle.y, vehicle.heading = there.tolist()
        vehicle.velocity = float(moved[0]) / span, float(moved[1]) / span
        along = math.cos(vehicle.heading) * moved[0] + math.sin(vehicle.heading) * moved[1]
        speed = math.copysign(speed, along)
        vehicle.acceleration, vehicle.speed = (speed - vehicle.speed) / dt, speed
        vehicle.yaw_rate = float(wrap_angle(there[2] - before[2])) / dt


@dataclass(frozen=True)
class Lqr:
    """nuPlan's tracker: two linear-quadratic regulators and a kinematic bicycle with its rear axle as reference.

    Source: nuplan-devkit, ``planning/simulation/controller/tracker/lqr.py``, ``tracker_utils.py`` and
    ``motion_model/kinematic_bicycle.py``, with the constants of ``config/simulation/ego_controller``. One regulator
    finds the acceleration for the speed of the trajectory at the horizon, one the steering rate for its lateral error,
    heading and steering angle there. The bicycle delays both.

    Attributes:
        speed_weight, acceleration_weight: Weights of the error and of the input in the longitudinal regulator.
        lateral_weight, heading_weight, steering_weight, rate_weight: Those of the lateral one.
        step, horizon: Length [s] and number of its steps.
        jerk_penalty, curvature_rate_penalty: Weights in the estimate of speeds and curvatures from poses.
        stopping_gain, stopping_speed: Proportional gain [1/s], below this speed [m/s].
        max_steering: [rad].
        acceleration_delay, steering_delay: Time constants of the low-pass filters [s].
        share: Wheelbase as a share of the length; both axles at equal distance from the centre.
    """

    speed_weight: float = 10.0
    acceleration_weight: float = 1.0
    lateral_weight: float = 1.0
    heading_weight: float = 10.0
    steering_weight: float = 0.0
    rate_weight: float = 1.0
    step: Positive = 0.1
    horizon: Count = 10
    jerk_penalty: float = 1e-4
    curvature_rate_penalty: float = 1e-2
    stopping_gain: float = 0.5
    stopping_speed: float = 0.2
    max_steering: float = math.pi / 3.0
    acceleration_delay: float = 0.2
    steering_delay: float = 0.05
    share: float = _WHEELBASE

    def __post_init__(self) -> None:
        check_settings(self)

    def wheelbase(self, length: float) -> float:
        """Return the distance between the axles of a vehicle [m]."""
        return self.share * length

    def follow(self, vehicle: TrackedVehicle, trajectory: Trajectory, dt: float) -> None:
        """Advance a vehicle by one step."""
        wheelbase = self.wheelbase(vehicle.length)
        if trajectory.times[0] > 0.0:  # from where the vehicle is
            start = np.array([[vehicle.x, vehicle.y, vehicle.heading]])
            trajectory = Trajectory(np.vstack([start, trajectory.poses]), np.append(0.0, trajectory.times))
        count = max(int(trajectory.times[-1] / self.step + 1e-6), 1)
        poses = trajectory.at(self.step * np.arange(count + 1))
        poses[:, :2] -= 0.5 * wheelbase * np.column_stack([np.cos(poses[:, 2]), np.sin(poses[:, 2])])
        cos, sin = math.cos(vehicle.heading), math.sin(vehicle.heading)
        rear = np.array([vehicle.x - 0.5 * wheelbase * cos, vehicle.y - 0.5 * wheelbase * sin, vehicle.heading])
        acceleration, rate = self.control(rear, vehicle.speed, vehicle.steering, poses, wheelbase)
        acceleration = vehicle.acceleration + dt / (dt + self.acceleration_delay) * (  # engine and steering are late
            acceleration - vehicle.acceleration
        )
        turned = dt / (dt + self.steering_delay) * rate * dt
        speed, heading = vehicle.speed, vehicle.heading
        x, y = rear[0] + speed * math.cos(heading) * dt, rear[1] + speed * math.sin(heading) * dt
        heading = float(wrap_angle(heading + speed * math.tan(vehicle.steering) / wheelbase * dt))
        vehicle.steering = min(max(vehicle.steering + turned, -self.max_steering), self.max_steering)
        vehicle.speed, vehicle.acceleration, vehicle.heading = speed + acceleration * dt, acceleration, heading
        vehicle.yaw_rate = vehicle.speed * math.tan(vehicle.steering) / wheelbase
        cos, sin, arm = math.cos(heading), math.sin(heading), 0.5 * wheelbase
        vehicle.x, vehicle.y = float(x) + arm * cos, float(y) + arm * sin
        across = arm * vehicle.yaw_rate
        vehicle.velocity = vehicle.speed * cos - across * sin, vehicle.speed * sin + across * cos

    def control(
        self, rear: Float64, speed: float, steering: float, poses: Float64, wheelbase: float
    ) -> tuple[float, float]:
        """Return the acceleration [m/s²] and the steering rate [rad/s].

        Args:
            rear: (3,) x, y [m] and heading [rad] of the rear axle.
            speed: Along the heading [m/s].
            steering: Angle of the front wheels [rad].
            poses: (K, 3) where the rear axle is to be, every ``step`` from now on; two or more.
            wheelbase: [m].
        """
        # Speeds and curvatures between poses, by least squares with penalties on the jerk and on changes of curvature.
        moved, before, h = np.diff(poses[:, :2], axis=0), poses[:-1, 2], self.step
        along = np.cos(before) * moved[:, 0] + np.sin(before) * moved[:, 1]
        last = len(along) - 1
        system: Array = h * h * np.eye(len(along)) + self.jerk_penalty / h**2 * _squared_differences(len(along), 2)
        speeds = np.asarray(np.linalg.solve(system, h * along), np.float64)
        turned, way = wrap_angle(np.diff(poses[:, 2])), speeds * h
        system = np.diag(way * way) + self.curvature_rate_penalty / h**2 * _squared_differences(len(way), 1)
        system[0, 0] += 1e-10  # a vehicle at rest has no curvature
        curvatures = np.asarray(np.linalg.solve(system, way * turned), np.float64)
        wanted = float(speeds[min(self.horizon, last)])
        if wanted <= self.stopping_speed and speed <= self.stopping_speed:
            return -self.stopping_gain * (speed - wanted), 0.0
        span = self.horizon * self.step
        gain = self.speed_weight * span / (self.speed_weight * span * span + self.acceleration_weight)
        acceleration = gain * (wanted - speed)
        apart = rear - poses[0]
        cos, sin = math.cos(poses[0, 2]), math.sin(poses[0, 2])
        errors = np.array([cos * apart[1] - sin * apart[0], float(wrap_angle(apart[2])), steering])
        coming: Float64 = speed + acceleration * self.step * np.arange(float(self.horizon))
        ahead = curvatures[np.minimum(np.arange(self.horizon), last)]
        return acceleration, self._steering_rate(errors, coming, ahead, wheelbase)

    def _steering_rate(self, errors: Float64, speeds: Float64, curvatures: Float64, wheelbase: float) -> float:
        """The constant steering rate that is best for the errors at the horizon, with the dynamics linearised."""
        h = self.step
        lateral, heading, steering = errors.tolist()
        by_lateral, by_heading, by_steering = 0.0, 0.0, 0.0  # the same per unit of the steering rate
        for speed, curvature in zip(speeds.tolist(), curvatures.tolist(), strict=True):
            way = speed * h
            lateral, heading = lateral + way * heading, heading + way * (steering / wheelbase - curvature)
            by_lateral, by_heading = by_lateral + way * by_heading, by_heading + way * by_steering / wheelbase
            by_steering += h
        state = np.array([lateral, *wrap_angle([heading, steering])])
        response = np.array([by_lateral, by_heading, by_steering])
        weighted = np.array([self.lateral_weight, self.heading_weight, self.steering_weight]) * response
        return -float(weighted @ state) / (float(weighted @ response) + self.rate_weight)
