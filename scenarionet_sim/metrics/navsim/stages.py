"""Pseudo closed loop: scores of a scene and of the scenes that may follow it, aggregated in two stages.

Source: navsim, ``planner/pdm_planner/scoring/scene_aggregator.py`` and ``script/run_pdm_score.py`` (definitions).
"""

from __future__ import annotations

import numpy as np

from scenarionet_data.arrays.dtypes import Float64

VARIANCE = 0.1
"""Of the Gaussian kernel on the distance to where a follow-up scene starts [m²]."""


def follow_up_weights(end: Float64, starts: Float64) -> Float64:
    """Weights (S,) of follow-up scenes, which add up to 1: those that start near the end of the plan count most.

    Args:
        end: (2,) last position of the plan in the first scene [m].
        starts: (S, 2) first positions of the follow-up scenes [m].
    """
    weights = np.exp(-((starts - end) ** 2).sum(axis=1) / (2.0 * VARIANCE))
    total = float(weights.sum())
    if np.isclose(total, 0.0):
        return np.full(len(starts), 1.0 / len(starts))
    normalised: Float64 = weights / total
    return normalised


def two_stage_score(first: float, followers: Float64, weights: Float64) -> float:
    """Score of a scene times the weighted mean of its follow-up scenes.

    The owner scores each scene twice, 0.5 s apart, and averages both results, then all scenes.

    Args:
        first: Score of the plan in the scene.
        followers: (S,) scores in the follow-up scenes.
        weights: (S,) see :func:`follow_up_weights`.
    """
    return first * float(followers @ weights / weights.sum())
