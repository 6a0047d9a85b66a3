"""Planners: from a view of the world in metres to an action or a trajectory, and the trackers that follow it."""

from scenarionet_sim.planners.base import Planner, Trajectory
from scenarionet_sim.planners.policy import Planned
from scenarionet_sim.planners.tracking import Lqr, PerfectTracking, TrackedVehicle, Tracker
from scenarionet_sim.planners.view import EgoView, LanesView, LightsView, ObjectsView, RouteView, View

__all__ = [
    "EgoView",
    "LanesView",
    "LightsView",
    "Lqr",
    "ObjectsView",
    "PerfectTracking",
    "Planned",
    "Planner",
    "RouteView",
    "TrackedVehicle",
    "Tracker",
    "Trajectory",
    "View",
]
