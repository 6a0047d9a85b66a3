"""nuPlan's metrics by the owner's definitions: collisions and fault, time to collision, open-loop errors, the score."""

from scenarionet_sim.metrics.drive import EgoDrive, SurroundingBoxes
from scenarionet_sim.metrics.nuplan.collisions import (
    CollisionGroup,
    CollisionKind,
    EgoCollision,
    collision_score,
    find_collisions,
)
from scenarionet_sim.metrics.nuplan.errors import PlanErrors, expert_distance, expert_distance_with_yaw, plan_errors
from scenarionet_sim.metrics.nuplan.scoring import closed_loop_score, driving_direction, speed_limit_score
from scenarionet_sim.metrics.nuplan.time_to_collision import time_to_collision

__all__ = [
    "CollisionGroup",
    "CollisionKind",
    "EgoCollision",
    "EgoDrive",
    "PlanErrors",
    "SurroundingBoxes",
    "closed_loop_score",
    "collision_score",
    "driving_direction",
    "expert_distance",
    "expert_distance_with_yaw",
    "find_collisions",
    "plan_errors",
    "speed_limit_score",
    "time_to_collision",
]
