"""nuPlan's metrics by the owner's definitions: collisions and fault, time to collision, open-loop errors, the score."""

from scenarionet_sim.metrics.drive import EgoDrive as EgoDrive
from scenarionet_sim.metrics.drive import SurroundingBoxes as SurroundingBoxes
from scenarionet_sim.metrics.nuplan.collisions import CollisionGroup as CollisionGroup
from scenarionet_sim.metrics.nuplan.collisions import CollisionKind as CollisionKind
from scenarionet_sim.metrics.nuplan.collisions import EgoCollision as EgoCollision
from scenarionet_sim.metrics.nuplan.collisions import collision_score as collision_score
from scenarionet_sim.metrics.nuplan.collisions import find_collisions as find_collisions
from scenarionet_sim.metrics.nuplan.errors import PlanErrors as PlanErrors
from scenarionet_sim.metrics.nuplan.errors import expert_distance as expert_distance
from scenarionet_sim.metrics.nuplan.errors import expert_distance_with_yaw as expert_distance_with_yaw
from scenarionet_sim.metrics.nuplan.errors import plan_errors as plan_errors
from scenarionet_sim.metrics.nuplan.scoring import closed_loop_score as closed_loop_score
from scenarionet_sim.metrics.nuplan.scoring import driving_direction as driving_direction
from scenarionet_sim.metrics.nuplan.scoring import speed_limit_score as speed_limit_score
from scenarionet_sim.metrics.nuplan.time_to_collision import time_to_collision as time_to_collision
