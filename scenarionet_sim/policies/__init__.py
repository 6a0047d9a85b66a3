"""What moves the objects of a world: the log, the laws of traffic, an action from outside, or nothing.

A policy is a frozen specification that pickles. A simulation takes several, and each object is driven by the last
one that wants it, so the general comes first: ``(Replay(), Idm(), External())``.
"""

from scenarionet_sim.policies.base import Policy
from scenarionet_sim.policies.constant_velocity import ConstantVelocity
from scenarionet_sim.policies.external import External
from scenarionet_sim.policies.idm import Idm
from scenarionet_sim.policies.objects import OfType, TrackIds, all_objects, ego, other_vehicles, others, vehicles
from scenarionet_sim.policies.replay import Replay
from scenarionet_sim.policies.route_follower import RouteFollower

__all__ = [
    "ConstantVelocity",
    "External",
    "Idm",
    "OfType",
    "Policy",
    "Replay",
    "RouteFollower",
    "TrackIds",
    "all_objects",
    "ego",
    "other_vehicles",
    "others",
    "vehicles",
]
