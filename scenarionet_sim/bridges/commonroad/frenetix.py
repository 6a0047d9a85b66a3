"""Frenetix (TUM), package frenetix 0.4: trajectories in a Frenet frame, sampled, checked and scored in C++.

The package is the core of the Frenetix-Motion-Planner, which is not on the package index. The loop around it is ours,
by that planner's ``reactive_planner_cpp.py``: its samples (densest level), limits, costs and weights (its
``cost.yaml`` and ``planning.yaml`` of August 2024), the cheapest trajectory that does not collide, and where all
do, the one that stops soonest. Behaviour planner, risk and learned forecasts are not in it.
"""

from __future__ import annotations

from itertools import product

import frenetix
import numpy as np
from commonroad_rp.utility.utils_coordinate_system import create_coordinate_system
from frenetix.trajectory_functions import FillCoordinates, cost_functions, feasability_functions

from scenarionet_data.arrays.dtypes import Float64
from scenarionet_sim.bridges.commonroad.planners import CommonRoadPlanner
from scenarionet_sim.bridges.commonroad.scene import CommonRoadScene

_SLOW = 2.0  # [m/s] below which lateral motion is sampled over the way instead of time
_TIMES = np.arange(1.1, 3.1, 0.3)  # [s] at which samples arrive
_OFFSETS = np.linspace(-3.0, 3.0, 9)  # [m] from the reference path at their end
_STEER, _STEER_RATE, _BRAKE, _SWITCH, _FASTEST = 1.066, 0.4, 11.5, 7.319, 50.8  # of a BMW 320i, CommonRoad's vehicle 2
_COVARIANCE = np.diag([0.1, 0.1, 0.0, 0.0, 0.0, 0.0])  # [m²] of forecasts


class CommonRoadFrenetix(CommonRoadPlanner):
    """Drives by Frenetix' trajectories."""

    horizon = 30

    def begin(self, scene: CommonRoadScene) -> None:
        """Take the reference path."""
        path = np.ascontiguousarray(create_coordinate_system(scene.reference).ref_path)
        self._system = frenetix.CoordinateSystemWrapper(path)
        self._wheelbase = 2.0 * scene.axle

    def plan(self, scene: CommonRoadScene, desired: float) -> Float64 | None:
        """Return the cheapest trajectory that does not collide, or the one that stops soonest."""
        start, seconds = scene.problem.initial_state, scene.scenario.dt * self.horizon
        is_slow = start.velocity < _SLOW
        back = scene.axle * np.array([np.cos(start.orientation), np.sin(start.orientation)])
        steering = float(np.arctan2(self._wheelbase * start.yaw_rate, max(start.velocity, 0.1)))
        state = frenetix.CartesianPlannerState(
            start.position - back, start.orientation, start.velocity, start.acceleration, steering
        )
        curved = frenetix.compute_initial_state(
            coordinate_system=self._system, x_0=state, wheelbase=self._wheelbase, low_velocity_mode=is_slow
        )
        handler = self._handler(scene, desired, is_slow=is_slow)
        handler.generate_trajectories(_samples(curved, start.velocity, seconds), is_slow)
        handler.evaluate_all_current_functions(True)
        feasible = [each for each in handler.get_sorted_trajectories() if each.feasible]
        for each in feasible:
            if not scene.collides(_poses(each)):
                return _poses(each)
        if start.velocity <= 0.1:
            return np.tile([*(start.position - back), start.orientation], (self.horizon + 1, 1))
        if not feasible:
            return None
        soonest = min(feasible, key=lambda each: tuple(each.sampling_parameters[[5, 1]]))
        return _poses(soonest)

    def _handler(self, scene: CommonRoadScene, desired: float, *, is_slow: bool) -> frenetix.TrajectoryHandler:
        handler, seconds = frenetix.TrajectoryHandler(dt=scene.scenario.dt), scene.scenario.dt * self.horizon
        limits, costs = feasability_functions, cost_functions
        for limit in (
            limits.CheckYawRateConstraint(_STEER, self._wheelbase, False),
            limits.CheckAccelerationConstraint(_SWITCH, _BRAKE, False),
            limits.CheckCurvatureConstraint(_STEER, self._wheelbase, False),
            limits.CheckCurvatureRateConstraint(self._wheelbase, _STEER_RATE, False),
        ):
            handler.add_feasability_function(limit)
        heading = scene.problem.initial_state.orientation
        handler.add_function(FillCoordinates(is_slow, heading, self._system, int(seconds)))
        for cost in (
            costs.CalculateLateralJerkCost("lateral_jerk", 0.2),
            costs.CalculateLongitudinalJerkCost("longitudinal_jerk", 0.2),
            costs.CalculateDistanceToReferencePathCost("distance_to_reference_path", 5.0),
            costs.CalculateVelocityOffsetCost(
                "velocity_offset", 1.0, desired, scene.scenario.dt, float(_TIMES[0]), False, 2
            ),
            costs.CalculateCollisionProbabilityFast(
                "prediction", 0.2, _forecasts(scene, self.horizon), scene.length, scene.width, scene.axle
            ),
        ):
            handler.add_cost_function(cost)
        return handler


def _poses(sample: frenetix.TrajectorySample) -> Float64:
    return np.column_stack([sample.cartesian.x, sample.cartesian.y, sample.cartesian.theta])


def _samples(curved: frenetix.CurvilinearPlannerState, speed: float, seconds: float) -> Float64:
    """Rows (S, 13) as frenetix takes them: begin and end in time, along and beside the reference path."""
    along, beside = np.asarray(curved.x0_lon).tolist(), np.asarray(curved.x0_lat).tolist()
    slowest = max(0.001, speed - _BRAKE * seconds)
    speeds = np.linspace(slowest, max(min(speed + _BRAKE / 6.0 * seconds, _FASTEST), slowest), 9)
    times, speeds = np.union1d(_TIMES.round(2), seconds), np.union1d(speeds, along[1])
    return np.array(
        [
            (0.0, time, *along, then, 0.0, *beside, offset, 0.0, 0.0)
            for time, then, offset in product(times, speeds, np.union1d(_OFFSETS, beside[0]))
        ]
    )


def _forecasts(scene: CommonRoadScene, horizon: int) -> dict[int, frenetix.PredictedObject]:
    """The obstacles of a scene as frenetix takes them."""
    found = {}
    for obstacle in scene.scenario.obstacles:
        states = [obstacle.state_at_time(step) or obstacle.initial_state for step in range(1, horizon + 1)]
        heading = obstacle.initial_state.orientation
        turn = np.array([0.0, 0.0, np.sin(0.5 * heading), np.cos(0.5 * heading)])
        path = [frenetix.PoseWithCovariance(np.append(each.position, 0.0), turn, _COVARIANCE) for each in states]
        shape, number = obstacle.obstacle_shape, obstacle.obstacle_id
        found[number] = frenetix.PredictedObject(number, path, shape.length, shape.width)
    return found
