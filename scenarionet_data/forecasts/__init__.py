"""Predicted trajectories: their scores as Argoverse, Waymo and nuScenes define them, and submissions."""

from __future__ import annotations

from scenarionet_data.forecasts.predictions import Prediction, make_predictions, read_predictions, write_predictions
from scenarionet_data.forecasts.scoring import ForecastScores, fan_of_velocities, score, summary
from scenarionet_data.forecasts.submissions import WaymoEntry, write_argoverse2, write_waymo

__all__ = [
    "ForecastScores",
    "Prediction",
    "WaymoEntry",
    "fan_of_velocities",
    "make_predictions",
    "read_predictions",
    "score",
    "summary",
    "write_argoverse2",
    "write_predictions",
    "write_waymo",
]
