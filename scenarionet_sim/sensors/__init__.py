"""Sensors of agents: frozen specifications that read the arrays of a batch and a state."""

from scenarionet_sim.sensors.base import Sensor
from scenarionet_sim.sensors.bird_view import BirdView, Channel
from scenarionet_sim.sensors.boundary import BoundaryDetector
from scenarionet_sim.sensors.camera import Camera, Mount
from scenarionet_sim.sensors.lane_line import LaneLineDetector
from scenarionet_sim.sensors.lidar import Lidar
from scenarionet_sim.sensors.light_ahead import LightAhead
from scenarionet_sim.sensors.navigation import Navigation
from scenarionet_sim.sensors.point_cloud import PointCloud
from scenarionet_sim.sensors.scene_lidar import SceneLidar
from scenarionet_sim.sensors.state import EgoState
from scenarionet_sim.sensors.surrounding import Surrounding

__all__ = [
    "BirdView",
    "BoundaryDetector",
    "Camera",
    "Channel",
    "EgoState",
    "LaneLineDetector",
    "Lidar",
    "LightAhead",
    "Mount",
    "Navigation",
    "PointCloud",
    "SceneLidar",
    "Sensor",
    "Surrounding",
]
