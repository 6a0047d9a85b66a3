"""WOSAC, the Waymo Open Sim Agents Challenge: score rollouts, read and write submissions."""

from scenarionet_sim.metrics.wosac.report import ScoredScenario, SubmissionReport, score_submission
from scenarionet_sim.metrics.wosac.run_rollouts import rollouts_of_run
from scenarionet_sim.metrics.wosac.scoring import (
    CONFIGURATIONS,
    SCENARIO_GENERATION_2025,
    SIM_AGENTS_2024,
    SIM_AGENTS_2025,
    Score,
    constant_velocity_rollouts,
    log_rollouts,
    mean_score,
    score,
)
from scenarionet_sim.metrics.wosac.submission import ScenarioRollouts, read_submission, write_submission

__all__ = [
    "CONFIGURATIONS",
    "SCENARIO_GENERATION_2025",
    "SIM_AGENTS_2024",
    "SIM_AGENTS_2025",
    "ScenarioRollouts",
    "Score",
    "ScoredScenario",
    "SubmissionReport",
    "constant_velocity_rollouts",
    "log_rollouts",
    "mean_score",
    "read_submission",
    "rollouts_of_run",
    "score",
    "score_submission",
    "write_submission",
]
