"""The simulator: Gymnasium and PettingZoo environments over the scenarios of a lake.

from scenarionet_sim import EnvConfig, Idm, External, Replay, ScenarioNetEnv, Scenarios

env = ScenarioNetEnv(scenarios=Scenarios("lake", "busy"), policies=(Replay(), Idm(), External()))

Importing the package registers ``ScenarioNet-v0`` (also as a vector environment) with Gymnasium, if that is
installed. All other names are imported on first use.
"""

from __future__ import annotations

import importlib
from importlib.util import find_spec
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from scenarionet_sim.backends.base import Drive
    from scenarionet_sim.backends.bullet import Bullet
    from scenarionet_sim.backends.fleet import Fleet
    from scenarionet_sim.backends.kinematic import Kinematic
    from scenarionet_sim.cameras.weather import Weather
    from scenarionet_sim.environments.config import (
        BOUNDARY,
        PAPER_OBSERVATION,
        EnvConfig,
        MultiAgentConfig,
        VectorConfig,
    )
    from scenarionet_sim.environments.flat import FlatEnv
    from scenarionet_sim.environments.multi_agent import ScenarioNetParallelEnv
    from scenarionet_sim.environments.single_agent import ScenarioNetEnv
    from scenarionet_sim.environments.vector import ScenarioNetVectorEnv
    from scenarionet_sim.evaluation.comparison import compare_runs
    from scenarionet_sim.evaluation.evaluation import evaluate
    from scenarionet_sim.evaluation.recording import record
    from scenarionet_sim.planners import Lqr, PerfectTracking, Planned, Planner, Trajectory, View
    from scenarionet_sim.planners.following import (
        ConstantVelocityPlanner,
        IdmPlanner,
        LogReplayPlanner,
        PurePursuitPlanner,
    )
    from scenarionet_sim.planners.lane_graph import LaneGraphPlanner
    from scenarionet_sim.policies import (
        ConstantVelocity,
        External,
        Idm,
        NoisyVelocity,
        Policy,
        Replay,
        RouteFollower,
        SampledIdm,
        SocialForce,
        ego,
        other_vehicles,
        vehicles,
    )
    from scenarionet_sim.render import Live, rollout_moments
    from scenarionet_sim.scenarios import Curriculum, Scenarios
    from scenarionet_sim.sensors import (
        BirdView,
        BoundaryDetector,
        Camera,
        EgoState,
        LaneLineDetector,
        Lidar,
        LightAhead,
        Mount,
        Navigation,
        PointCloud,
        SceneLidar,
        Sensor,
        Surrounding,
    )
    from scenarionet_sim.sensors.camera_presets import camera_ring
    from scenarionet_sim.simulation.simulation import Simulation
    from scenarionet_sim.task.task import Reward, Termination
    from scenarionet_sim.worlds.lane_routes import LaneRoute
    from scenarionet_sim.worlds.world import World

_MODULE_OF = {
    "BOUNDARY": "environments.config",
    "BirdView": "sensors",
    "BoundaryDetector": "sensors",
    "Bullet": "backends.bullet",
    "Camera": "sensors",
    "ConstantVelocity": "policies",
    "ConstantVelocityPlanner": "planners.following",
    "Curriculum": "scenarios",
    "Drive": "backends.base",
    "EgoState": "sensors",
    "EnvConfig": "environments.config",
    "External": "policies",
    "FlatEnv": "environments.flat",
    "Fleet": "backends.fleet",
    "Idm": "policies",
    "IdmPlanner": "planners.following",
    "Kinematic": "backends.kinematic",
    "LaneGraphPlanner": "planners.lane_graph",
    "LaneLineDetector": "sensors",
    "LaneRoute": "worlds.lane_routes",
    "Lidar": "sensors",
    "LightAhead": "sensors",
    "Live": "render",
    "LogReplayPlanner": "planners.following",
    "Lqr": "planners",
    "Mount": "sensors",
    "MultiAgentConfig": "environments.config",
    "Navigation": "sensors",
    "NoisyVelocity": "policies",
    "PAPER_OBSERVATION": "environments.config",
    "PerfectTracking": "planners",
    "Planned": "planners",
    "Planner": "planners",
    "PointCloud": "sensors",
    "SceneLidar": "sensors",
    "Policy": "policies",
    "PurePursuitPlanner": "planners.following",
    "Replay": "policies",
    "Reward": "task.task",
    "RouteFollower": "policies",
    "SampledIdm": "policies",
    "ScenarioNetEnv": "environments.single_agent",
    "ScenarioNetParallelEnv": "environments.multi_agent",
    "ScenarioNetVectorEnv": "environments.vector",
    "Scenarios": "scenarios",
    "Sensor": "sensors",
    "Simulation": "simulation.simulation",
    "SocialForce": "policies",
    "Surrounding": "sensors",
    "Termination": "task.task",
    "Trajectory": "planners",
    "VectorConfig": "environments.config",
    "View": "planners",
    "Weather": "cameras.weather",
    "World": "worlds.world",
    "camera_ring": "sensors.camera_presets",
    "compare_runs": "evaluation.comparison",
    "ego": "policies",
    "evaluate": "evaluation.evaluation",
    "other_vehicles": "policies",
    "record": "evaluation.recording",
    "rollout_moments": "render",
    "vehicles": "policies",
}
"""Module of each public name; a test compares it with the imports above and with ``__all__``."""

__all__ = [
    "BOUNDARY",
    "PAPER_OBSERVATION",
    "BirdView",
    "BoundaryDetector",
    "Bullet",
    "Camera",
    "ConstantVelocity",
    "ConstantVelocityPlanner",
    "Curriculum",
    "Drive",
    "EgoState",
    "EnvConfig",
    "External",
    "FlatEnv",
    "Fleet",
    "Idm",
    "IdmPlanner",
    "Kinematic",
    "LaneGraphPlanner",
    "LaneLineDetector",
    "LaneRoute",
    "Lidar",
    "LightAhead",
    "Live",
    "LogReplayPlanner",
    "Lqr",
    "Mount",
    "MultiAgentConfig",
    "Navigation",
    "NoisyVelocity",
    "PerfectTracking",
    "Planned",
    "Planner",
    "PointCloud",
    "Policy",
    "PurePursuitPlanner",
    "Replay",
    "Reward",
    "RouteFollower",
    "SampledIdm",
    "ScenarioNetEnv",
    "ScenarioNetParallelEnv",
    "ScenarioNetVectorEnv",
    "Scenarios",
    "SceneLidar",
    "Sensor",
    "Simulation",
    "SocialForce",
    "Surrounding",
    "Termination",
    "Trajectory",
    "VectorConfig",
    "View",
    "Weather",
    "World",
    "camera_ring",
    "compare_runs",
    "ego",
    "evaluate",
    "other_vehicles",
    "record",
    "rollout_moments",
    "vehicles",
]


def __getattr__(name: str) -> Any:
    """Import a public name on first use: registering the environments needs neither numba nor DuckDB."""
    if name not in _MODULE_OF:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(importlib.import_module(f"{__name__}.{_MODULE_OF[name]}"), name)


def __dir__() -> list[str]:
    return sorted(__all__)


if find_spec("gymnasium"):
    import gymnasium

    gymnasium.register(
        "ScenarioNet-v0",
        entry_point="scenarionet_sim.environments.single_agent:ScenarioNetEnv",
        vector_entry_point="scenarionet_sim.environments.vector:ScenarioNetVectorEnv",
    )
    gymnasium.register(
        "ScenarioNet-MultiAgent-v0", entry_point="scenarionet_sim.environments.multi_agent:not_for_gymnasium"
    )
