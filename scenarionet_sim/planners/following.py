"""Drivers that follow a line: the recording, constant velocity, pure pursuit, and the Intelligent Driver Model.

Each is a few dozen lines to copy from. ``sim --policy`` knows them by module and class, for example
``scenarionet_sim.planners.following:IdmPlanner``.
"""

from __future__ import annotations

import math

import numpy as np

from scenarionet_data.arrays.dtypes import Float64
from scenarionet_sim.arrays.log import HEADING, VALID, X, Y
from scenarionet_sim.planners.base import Action, Planner, Trajectory
from scenarionet_sim.planners.view import View
from scenarionet_sim.planners.way import Obstacles, Way

HORIZON, STEP = 4.0, 0.1
"""Length of the plans and the time between their poses [s]."""


class LogReplayPlanner(Planner):
    """Drives as recorded: the ceiling of a tracker."""

    def act(self, view: View) -> Trajectory:
        """Return the recorded poses from now on, so that a tracker sees its error; after the last, stand still."""
        log = view.log
        (steps,) = np.nonzero(log[:, VALID])
        now = np.clip(view.timestep, steps[0], steps[-1])
        part = steps[(steps >= now) & (steps <= now + round(HORIZON / view.dt))]
        poses, times = log[part][:, [X, Y, HEADING]], view.dt * (part - now)
        if len(part) < 2:
            return Trajectory(np.repeat(poses, 2, axis=0), np.array([0.0, HORIZON]))
        return Trajectory(poses, times)


class ConstantVelocityPlanner(Planner):
    """Straight on at the current speed."""

    frame = "ego"

    def act(self, view: View) -> Trajectory:
        """Return a straight trajectory, in the frame of the vehicle."""
        times = STEP * np.arange(1, round(HORIZON / STEP) + 1)
        return Trajectory(np.column_stack([view.ego.speed * times, np.zeros((len(times), 2))]), times)


class PurePursuitPlanner(Planner):
    """Steers along the arc to a point of the route ahead, and controls its speed in proportion; returns actions.

    Coulter, Implementation of the Pure Pursuit Path Tracking Algorithm (1992). The point is 1 s ahead, at least 4 m.
    """

    frame = "ego"
    speed = 10.0
    """[m/s]"""

    def act(self, view: View) -> Action:
        """Return steering and throttle."""
        way = Way.ahead(view)
        x, y, _ = way.at(max(4.0, view.ego.speed)).tolist()
        rear = 0.3 * view.ego.length  # from the centre to the rear axle, by the share of ``Drive.wheelbase``
        curvature = 2.0 * y / ((x + rear) ** 2 + y**2)
        angle = math.atan(2.0 * rear * curvature)
        wanted = min(self.speed, way.speed_for_bends(3.0, 1.0))
        return [angle / math.radians(40.0), 0.5 * (wanted - view.ego.speed)]


class IdmPlanner(Planner):
    """Along the route by the Intelligent Driver Model (Treiber, Hennecke, Helbing 2000); returns trajectories.

    It keeps a headway to objects on its way, stops at red lights, and slows down for bends and speed limits.
    """

    speed, headway, acceleration, deceleration, standstill = 12.0, 1.5, 1.5, 3.0, 2.0
    """Desired speed where no limit is known [m/s], time gap [s], [m/s²], [m/s²], gap at rest [m]."""

    def act(self, view: View) -> Trajectory:
        """Return a trajectory in the middle of the route, to which the tracker leads back."""
        way = Way.ahead(view)
        obstacles = Obstacles.on(way, view)
        is_ahead = (obstacles.arc > 0.0) & (np.abs(obstacles.lateral) < obstacles.half_width + 0.5 * view.ego.width)
        gaps = np.where(is_ahead, obstacles.arc - obstacles.half_length - 0.5 * view.ego.length, np.inf)
        leader = int(np.argmin(gaps)) if len(gaps) else None
        gap, leading = (np.inf, 0.0) if leader is None else (float(gaps[leader]), float(obstacles.speed[leader]))
        desired = min(desired_speed(view, self.speed), way.speed_for_bends(3.0, 0.5 * self.deceleration))
        arcs, _ = self.drive(np.array(max(view.ego.speed, 0.0)), desired, np.array(gap), leading)
        return Trajectory(way.pose(np.append(0.0, arcs)), STEP * np.arange(len(arcs) + 1))

    def drive(
        self, speed: Float64, desired: Float64 | float, gap: Float64, leading: Float64 | float
    ) -> tuple[Float64, Float64]:
        """Return distances (..., T) [m] and speeds (..., T) [m/s] of drives at every ``STEP`` of the horizon.

        Args:
            speed: (...) at first [m/s].
            desired: Desired speed [m/s].
            gap, leading: Free way at first [m], and the speed of the object behind it [m/s], which it keeps.
        """
        arc, arcs, speeds = np.zeros_like(speed), [], []
        for _ in range(round(HORIZON / STEP)):  # each moment depends on the one before
            then = np.maximum(speed + self.accelerate(speed, desired, gap - arc, leading) * STEP, 0.0)
            arc, gap, speed = arc + 0.5 * (speed + then) * STEP, gap + leading * STEP, then
            arcs.append(arc)
            speeds.append(speed)
        return np.stack(arcs, axis=-1), np.stack(speeds, axis=-1)

    def accelerate(self, speed: Float64, desired: Float64 | float, gap: Float64, leading: Float64 | float) -> Float64:
        """Return the acceleration by the model [m/s²], at least an emergency stop."""
        closing = speed * (speed - leading) / (2.0 * math.sqrt(self.acceleration * self.deceleration))
        wanted = self.standstill + np.maximum(speed * self.headway + closing, 0.0)
        free = (speed / desired) ** 4
        law = self.acceleration * (1.0 - free - (wanted / np.maximum(gap, 0.1)) ** 2)
        return np.asarray(np.maximum(law, -8.0))


def desired_speed(view: View, unlimited: float) -> float:
    """Return the speed limit where the vehicle is on its route [m/s], or another speed where none is known."""
    route = view.route
    if not len(route.arc):
        return unlimited
    limit = float(route.speed_limit[min(int(np.searchsorted(route.arc, route.position)), len(route.arc) - 1)])
    return limit if math.isfinite(limit) else unlimited
