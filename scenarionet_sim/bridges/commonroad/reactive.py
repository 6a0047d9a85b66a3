"""The reactive planner of CommonRoad (Werling et al. 2010; TUM), package commonroad-reactive-planner 2025.1."""

from __future__ import annotations

import logging

import numpy as np
from commonroad.scenario.scenario import Scenario
from commonroad_rp.reactive_planner import ReactivePlanner
from commonroad_rp.state import ReactivePlannerState
from commonroad_rp.utility.config import ReactivePlannerConfiguration, VehicleConfiguration
from commonroad_rp.utility.utils_coordinate_system import create_coordinate_system

from scenarionet_data.arrays.dtypes import Float64
from scenarionet_sim.bridges.commonroad.planners import CommonRoadPlanner
from scenarionet_sim.bridges.commonroad.scene import CommonRoadScene


class CommonRoadReactive(CommonRoadPlanner):
    """Drives by the reactive planner with its default configuration."""

    horizon = 30

    def begin(self, scene: CommonRoadScene) -> None:
        """Configure the planner."""
        vehicle = VehicleConfiguration(
            length=scene.length, width=scene.width, wb_front_axle=scene.axle, wb_rear_axle=scene.axle
        )
        config = ReactivePlannerConfiguration(vehicle=vehicle)
        config.debug.multiproc, config.debug.logging_level = False, logging.getLevelName(logging.ERROR)
        config.planning.time_steps_computation = self.horizon
        config.planning.planning_horizon = self.horizon * config.planning.dt
        config.update(Scenario(scene.scenario.dt), scene.problem)  # its map and obstacles come with the scene's checker
        self._config = config
        self._system = create_coordinate_system(scene.reference)
        self._planner = ReactivePlanner(config)

    def plan(self, scene: CommonRoadScene, desired: float) -> Float64 | None:
        """Return the states of the planner's best trajectory."""
        planner, vehicle = self._planner, self._config.vehicle
        start = ReactivePlannerState.create_from_initial_state(
            scene.problem.initial_state, vehicle.wheelbase, vehicle.wb_rear_axle
        )
        planner.reset(initial_state_cart=start, collision_checker=scene.checker, coordinate_system=self._system)
        planner.set_desired_velocity(desired, start.velocity)
        found = planner.plan()
        if found is None:
            return None
        return np.array([[*state.position, state.orientation] for state in found[0].state_list])
