"""NAVSIM's scores of plans by the owner's definitions: PDMS, EPDMS with all parts, and the two-stage aggregation."""

from scenarionet_sim.metrics.drive import EgoDrive, SurroundingBoxes
from scenarionet_sim.metrics.navsim.comfort import is_history_comfortable, is_plan_comfortable, is_two_frame_comfortable
from scenarionet_sim.metrics.navsim.parts import measure_plan
from scenarionet_sim.metrics.navsim.scene import PlanScene
from scenarionet_sim.metrics.navsim.scoring import (
    PlanParts,
    epdms,
    filter_by_human,
    normalised_progress,
    pdms,
    score_plans,
)
from scenarionet_sim.metrics.navsim.stages import follow_up_weights, two_stage_score

__all__ = [
    "EgoDrive",
    "PlanParts",
    "PlanScene",
    "SurroundingBoxes",
    "epdms",
    "filter_by_human",
    "follow_up_weights",
    "is_history_comfortable",
    "is_plan_comfortable",
    "is_two_frame_comfortable",
    "measure_plan",
    "normalised_progress",
    "pdms",
    "score_plans",
    "two_stage_score",
]
