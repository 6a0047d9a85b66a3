"""Policies: replay of the log, reactive traffic, constant velocity, and external actions.

A policy is a frozen, picklable specification. A simulation takes several, and each object is driven by the last one
that selects it, so the most general comes first: ``(Replay(), Idm(), External())``.
"""

from scenarionet_sim.policies.base import Policy
from scenarionet_sim.policies.constant_velocity import ConstantVelocity
from scenarionet_sim.policies.external import External
from scenarionet_sim.policies.idm import Idm
from scenarionet_sim.policies.objects import OfType, TrackIds, all_objects, ego, other_vehicles, others, vehicles
from scenarionet_sim.policies.replay import Replay
from scenarionet_sim.policies.route_follower import RouteFollower
from scenarionet_sim.policies.sampled import NoisyVelocity, SampledIdm
from scenarionet_sim.policies.social_force import SocialForce, pedestrians_and_cyclists

__all__ = [
    "ConstantVelocity",
    "External",
    "Idm",
    "NoisyVelocity",
    "OfType",
    "Policy",
    "Replay",
    "RouteFollower",
    "SampledIdm",
    "SocialForce",
    "TrackIds",
    "all_objects",
    "ego",
    "other_vehicles",
    "others",
    "pedestrians_and_cyclists",
    "vehicles",
]
