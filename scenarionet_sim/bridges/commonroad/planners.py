"""Planners of the package index that speak CommonRoad, driving as planners of this software.

Their settings are those that they come with; the vehicle's size is that of the recorded one.
"""

from __future__ import annotations

from abc import abstractmethod

import numpy as np

from scenarionet_data.arrays.dtypes import Float64
from scenarionet_sim.bridges.commonroad.scene import CommonRoadScene
from scenarionet_sim.planners.base import Planner, Trajectory
from scenarionet_sim.planners.following import IdmPlanner, desired_speed
from scenarionet_sim.planners.view import View
from scenarionet_sim.planners.way import Way

REPLAN = 3
"""Timesteps between two plans, as both planners are set by default."""

_BRAKE = 6.0  # [m/s²] where there is no plan


class CommonRoadPlanner(Planner):
    """Asks a planner of CommonRoad every third timestep, and drives by its newest plan until then.

    Where it finds none, the vehicle brakes with 6 m/s² beside its route until then. To find none takes longest: the
    reactive planner tries ever denser samples, in 1 to 2 s, and answers in 0.07 s where it finds one.

    Attributes:
        horizon: Timesteps of a plan.
        num_plans, num_failed: How often it was asked, and found none.
    """

    horizon: int

    def __init__(self) -> None:
        self.num_plans = self.num_failed = 0
        self._since = REPLAN
        self._scene: CommonRoadScene | None = None
        self._plan: Float64 | None = None

    def act(self, view: View) -> Trajectory:
        """Return the plan from now on."""
        if self._scene is None:
            self._scene = CommonRoadScene(view, self.horizon)
            self.begin(self._scene)
        self._since += 1
        if self._since >= REPLAN:
            self._scene.show(view)
            self._plan, self._since = self.plan(self._scene, speed_ahead(view)), 0
            self.num_plans += 1
            self.num_failed += self._plan is None
        if self._plan is None:
            return braking(view)
        rear, axle = self._plan[self._since :], self._scene.axle
        cos, sin = np.cos(rear[:, 2]), np.sin(rear[:, 2])
        poses = np.column_stack([rear[:, 0] + axle * cos, rear[:, 1] + axle * sin, rear[:, 2]])
        return Trajectory(poses, view.dt * np.arange(len(poses)))

    @abstractmethod
    def begin(self, scene: CommonRoadScene) -> None:
        """Take the scene of an episode."""

    @abstractmethod
    def plan(self, scene: CommonRoadScene, desired: float) -> Float64 | None:
        """Return poses (T, 3) of the rear axle, from now on at every timestep; None without a plan.

        Args:
            scene: The scene as it is now.
            desired: Speed to drive at [m/s].
        """


def speed_ahead(view: View) -> float:
    """Return the speed limit, or 12 m/s without one, and less before bends, as ``IdmPlanner`` does [m/s]."""
    bends = Way.ahead(view).speed_for_bends(3.0, 0.5 * IdmPlanner.deceleration)
    return min(desired_speed(view, IdmPlanner.speed), bends)


def braking(view: View) -> Trajectory:
    """Return a drive to rest beside the route, as far from it as now."""
    way, times = Way.ahead(view), 0.1 * np.arange(41)
    arcs = np.maximum(view.ego.speed, 0.0) * np.minimum(times, end := max(view.ego.speed, 0.0) / _BRAKE)
    arcs -= 0.5 * _BRAKE * np.minimum(times, end) ** 2
    return Trajectory(way.pose(arcs, way.lateral), times)
