"""Waymax's metrics by the owner's definitions: overlap, roads, routes, divergence and kinematic infeasibility."""

from scenarionet_sim.metrics.waymax.kinematics import is_infeasible as is_infeasible
from scenarionet_sim.metrics.waymax.overlap import overlaps as overlaps
from scenarionet_sim.metrics.waymax.roadgraph import RoadEdges as RoadEdges
from scenarionet_sim.metrics.waymax.roadgraph import is_offroad as is_offroad
from scenarionet_sim.metrics.waymax.routes import RouteDistances as RouteDistances
from scenarionet_sim.metrics.waymax.routes import Routes as Routes
from scenarionet_sim.metrics.waymax.routes import off_route as off_route
from scenarionet_sim.metrics.waymax.routes import wrong_way as wrong_way
