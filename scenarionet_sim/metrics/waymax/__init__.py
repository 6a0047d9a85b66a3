"""Waymax's metrics by the owner's definitions: overlap, roads, routes, divergence and kinematic infeasibility."""

from scenarionet_sim.metrics.waymax.kinematics import is_infeasible
from scenarionet_sim.metrics.waymax.overlap import overlaps
from scenarionet_sim.metrics.waymax.roadgraph import RoadEdges, is_offroad
from scenarionet_sim.metrics.waymax.routes import Routes, off_route, progression, wrong_way

__all__ = [
    "RoadEdges",
    "Routes",
    "is_infeasible",
    "is_offroad",
    "off_route",
    "overlaps",
    "progression",
    "wrong_way",
]
