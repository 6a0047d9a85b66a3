"""NAVSIM's scores of plans by the owner's definitions: PDMS, EPDMS with all parts, and the two-stage aggregation."""

from scenarionet_sim.metrics.drive import EgoDrive as EgoDrive
from scenarionet_sim.metrics.drive import SurroundingBoxes as SurroundingBoxes
from scenarionet_sim.metrics.navsim.comfort import is_history_comfortable as is_history_comfortable
from scenarionet_sim.metrics.navsim.comfort import is_plan_comfortable as is_plan_comfortable
from scenarionet_sim.metrics.navsim.comfort import is_two_frame_comfortable as is_two_frame_comfortable
from scenarionet_sim.metrics.navsim.parts import measure_plan as measure_plan
from scenarionet_sim.metrics.navsim.scene import PlanScene as PlanScene
from scenarionet_sim.metrics.navsim.scoring import PlanParts as PlanParts
from scenarionet_sim.metrics.navsim.scoring import epdms as epdms
from scenarionet_sim.metrics.navsim.scoring import filter_by_human as filter_by_human
from scenarionet_sim.metrics.navsim.scoring import normalised_progress as normalised_progress
from scenarionet_sim.metrics.navsim.scoring import pdms as pdms
from scenarionet_sim.metrics.navsim.scoring import score_plans as score_plans
from scenarionet_sim.metrics.navsim.stages import follow_up_weights as follow_up_weights
from scenarionet_sim.metrics.navsim.stages import two_stage_score as two_stage_score
