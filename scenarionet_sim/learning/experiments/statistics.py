"""Verdicts: computed from the runs, never typed."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Literal

import numpy as np
import numpy.typing as npt

from scenarionet_sim.evaluation.intervals import CONFIDENCE, Interval, mean_interval

Verdict = Literal["supported", "not supported", "inconclusive"]

FLAT = 0.05
"""A curve has flattened if its mean over the last quarter differs from the quarter before by at most this."""


CEILING = 0.95
"""From this success of all compared arms on, a test cannot tell them apart."""


def has_flattened(curves: npt.ArrayLike) -> bool:
    """Return whether the mean of learning curves (seeds, checkpoints) has stopped to change."""
    mean = np.asarray(curves, np.float64).mean(axis=0)
    quarter = max(len(mean) // 4, 1)
    if len(mean) < 2 * quarter or len(mean) < 4:
        return False
    return bool(abs(mean[-quarter:].mean() - mean[-2 * quarter : -quarter].mean()) <= FLAT)


def verdict(differences: npt.ArrayLike, *, are_flat: bool, claims: int = 1) -> tuple[Verdict, Interval]:
    """Return what paired differences (one per seed) say about the claim that they are positive.

    Supported if the whole interval is above 0, not supported if it is below, otherwise inconclusive; inconclusive in
    any case if a curve has not flattened. With several claims the interval is wider (Bonferroni), so that all intervals
    together hold with 95 %.
    """
    interval = mean_interval(differences, 1.0 - (1.0 - CONFIDENCE) / claims)
    if not are_flat or interval.low <= 0.0 <= interval.high:
        return "inconclusive", interval
    return ("supported" if interval.low > 0.0 else "not supported"), interval


def holm(differences: Sequence[npt.ArrayLike]) -> list[int]:
    """Return by how much the error of each of several claims is divided, from their paired differences (Holm 1979)."""

    def clearness(values: npt.ArrayLike) -> float:
        interval = mean_interval(values)
        reach = interval.high - interval.mean
        return abs(interval.mean) / reach if reach > 0.0 else float("inf") if interval.mean else 0.0

    level, is_clear, levels = len(differences), True, [0] * len(differences)
    for k in sorted(range(len(differences)), key=lambda k: clearness(differences[k]), reverse=True):
        levels[k] = level
        is_clear = is_clear and verdict(differences[k], are_flat=True, claims=level)[0] != "inconclusive"
        level -= is_clear
    return levels
