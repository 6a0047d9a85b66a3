"""WOSAC, the Waymo Open Sim Agents Challenge: score rollouts, read and write submissions."""

from scenarionet_sim.metrics.wosac.report import ScoredScenario as ScoredScenario
from scenarionet_sim.metrics.wosac.report import SubmissionReport as SubmissionReport
from scenarionet_sim.metrics.wosac.report import score_submission as score_submission
from scenarionet_sim.metrics.wosac.run_rollouts import rollouts_of_run as rollouts_of_run
from scenarionet_sim.metrics.wosac.scoring import CONFIGURATIONS as CONFIGURATIONS
from scenarionet_sim.metrics.wosac.scoring import SCENARIO_GENERATION_2025 as SCENARIO_GENERATION_2025
from scenarionet_sim.metrics.wosac.scoring import SIM_AGENTS_2024 as SIM_AGENTS_2024
from scenarionet_sim.metrics.wosac.scoring import SIM_AGENTS_2025 as SIM_AGENTS_2025
from scenarionet_sim.metrics.wosac.scoring import Score as Score
from scenarionet_sim.metrics.wosac.scoring import constant_velocity_rollouts as constant_velocity_rollouts
from scenarionet_sim.metrics.wosac.scoring import log_rollouts as log_rollouts
from scenarionet_sim.metrics.wosac.scoring import mean_score as mean_score
from scenarionet_sim.metrics.wosac.scoring import score as score
from scenarionet_sim.metrics.wosac.submission import ScenarioRollouts as ScenarioRollouts
from scenarionet_sim.metrics.wosac.submission import read_submission as read_submission
from scenarionet_sim.metrics.wosac.submission import write_submission as write_submission
