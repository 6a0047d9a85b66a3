"""The simulator: Gymnasium and PettingZoo environments over the scenarios of a lake.

from scenarionet_sim import EnvConfig, Idm, External, Replay, ScenarioNetEnv, Scenarios

env = ScenarioNetEnv(scenarios=Scenarios("lake", "busy"), policies=(Replay(), Idm(), External()))

Importing the package registers ``ScenarioNet-v0`` (also as a vector environment) with Gymnasium, if that is
installed. All other names are imported on first use.
"""

from __future__ import annotations

from importlib.util import find_spec
from typing import TYPE_CHECKING

from scenarionet_data.public_names import import_on_first_use

if TYPE_CHECKING:
    from scenarionet_sim.backends.base import Drive as Drive
    from scenarionet_sim.backends.bullet import Bullet as Bullet
    from scenarionet_sim.backends.fleet import Fleet as Fleet
    from scenarionet_sim.backends.kinematic import Kinematic as Kinematic
    from scenarionet_sim.borders.search import SearchReport as SearchReport
    from scenarionet_sim.borders.search import SearchSpace as SearchSpace
    from scenarionet_sim.borders.search import search as search
    from scenarionet_sim.cameras.weather import Weather as Weather
    from scenarionet_sim.environments.config import BOUNDARY as BOUNDARY
    from scenarionet_sim.environments.config import PAPER_OBSERVATION as PAPER_OBSERVATION
    from scenarionet_sim.environments.config import EnvConfig as EnvConfig
    from scenarionet_sim.environments.config import MultiAgentConfig as MultiAgentConfig
    from scenarionet_sim.environments.config import VectorConfig as VectorConfig
    from scenarionet_sim.environments.flat import FlatEnv as FlatEnv
    from scenarionet_sim.environments.multi_agent import ScenarioNetParallelEnv as ScenarioNetParallelEnv
    from scenarionet_sim.environments.single_agent import ScenarioNetEnv as ScenarioNetEnv
    from scenarionet_sim.environments.vector import ScenarioNetVectorEnv as ScenarioNetVectorEnv
    from scenarionet_sim.evaluation.comparison import compare_runs as compare_runs
    from scenarionet_sim.evaluation.evaluation import evaluate as evaluate
    from scenarionet_sim.evaluation.offline import record_episodes as record_episodes
    from scenarionet_sim.evaluation.recording import record as record
    from scenarionet_sim.planners.base import Planner as Planner
    from scenarionet_sim.planners.base import Trajectory as Trajectory
    from scenarionet_sim.planners.following import ConstantVelocityPlanner as ConstantVelocityPlanner
    from scenarionet_sim.planners.following import IdmPlanner as IdmPlanner
    from scenarionet_sim.planners.following import LogReplayPlanner as LogReplayPlanner
    from scenarionet_sim.planners.following import PurePursuitPlanner as PurePursuitPlanner
    from scenarionet_sim.planners.lane_graph import LaneGraphPlanner as LaneGraphPlanner
    from scenarionet_sim.planners.policy import Planned as Planned
    from scenarionet_sim.planners.tracking import Lqr as Lqr
    from scenarionet_sim.planners.tracking import PerfectTracking as PerfectTracking
    from scenarionet_sim.planners.view import View as View
    from scenarionet_sim.policies.base import Policy as Policy
    from scenarionet_sim.policies.constant_velocity import ConstantVelocity as ConstantVelocity
    from scenarionet_sim.policies.external import External as External
    from scenarionet_sim.policies.idm import Idm as Idm
    from scenarionet_sim.policies.objects import ego as ego
    from scenarionet_sim.policies.objects import other_vehicles as other_vehicles
    from scenarionet_sim.policies.objects import vehicles as vehicles
    from scenarionet_sim.policies.replay import Replay as Replay
    from scenarionet_sim.policies.route_follower import RouteFollower as RouteFollower
    from scenarionet_sim.policies.route_sight import Guidance as Guidance
    from scenarionet_sim.policies.route_sight import RouteTraffic as RouteTraffic
    from scenarionet_sim.policies.sampled import NoisyVelocity as NoisyVelocity
    from scenarionet_sim.policies.sampled import SampledIdm as SampledIdm
    from scenarionet_sim.policies.social_force import SocialForce as SocialForce
    from scenarionet_sim.regression.regress import RegressionPlan as RegressionPlan
    from scenarionet_sim.regression.regress import RegressionReport as RegressionReport
    from scenarionet_sim.regression.regress import regress as regress
    from scenarionet_sim.regression.reproduction import drive_again as drive_again
    from scenarionet_sim.render.live import Live as Live
    from scenarionet_sim.render.rollouts import rollout_moments as rollout_moments
    from scenarionet_sim.scenarios.sampling import Curriculum as Curriculum
    from scenarionet_sim.scenarios.selection import Scenarios as Scenarios
    from scenarionet_sim.sensors.base import Sensor as Sensor
    from scenarionet_sim.sensors.bird_view import BirdView as BirdView
    from scenarionet_sim.sensors.camera import Camera as Camera
    from scenarionet_sim.sensors.camera import Mount as Mount
    from scenarionet_sim.sensors.camera_presets import camera_ring as camera_ring
    from scenarionet_sim.sensors.lidar import Lidar as Lidar
    from scenarionet_sim.sensors.line_rays import BoundaryDetector as BoundaryDetector
    from scenarionet_sim.sensors.line_rays import LaneLineDetector as LaneLineDetector
    from scenarionet_sim.sensors.navigation import LightAhead as LightAhead
    from scenarionet_sim.sensors.navigation import Navigation as Navigation
    from scenarionet_sim.sensors.point_cloud import PointCloud as PointCloud
    from scenarionet_sim.sensors.scene_lidar import SceneLidar as SceneLidar
    from scenarionet_sim.sensors.state import EgoState as EgoState
    from scenarionet_sim.sensors.surrounding import RoadSegments as RoadSegments
    from scenarionet_sim.sensors.surrounding import Surrounding as Surrounding
    from scenarionet_sim.simulation.simulation import Simulation as Simulation
    from scenarionet_sim.task.task import Reward as Reward
    from scenarionet_sim.task.task import Termination as Termination
    from scenarionet_sim.worlds.lane_routes import LaneRoute as LaneRoute
    from scenarionet_sim.worlds.world import World as World

__getattr__, __dir__, __all__ = import_on_first_use(__name__, __file__)

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
