"""Intervals and verdicts: computed from the runs, never typed."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
import numpy.typing as npt

from scenarionet_data.arrays.dtypes import Float64

Verdict = Literal["supported", "not supported", "inconclusive"]

RESAMPLES = 10_000
"""Bootstrap resamples; all with the same seed, so that a page can be computed again."""

FLAT = 0.05
"""A curve has flattened if its mean over the last quarter differs from the quarter before by at most this."""


@dataclass(frozen=True)
class Interval:
    """A mean with its 95 % bootstrap interval."""

    mean: float
    low: float
    high: float

    def __str__(self) -> str:
        return f"{self.mean:.3f} [{self.low:.3f}, {self.high:.3f}]"


def bootstrap(values: npt.ArrayLike) -> Interval:
    """Return the mean of values (one per seed) with the percentile interval of resampled seeds.

    With few seeds such intervals are too narrow (for 5 values by about a third): they are descriptions of the spread.
    """
    given: Float64 = np.asarray(values, np.float64)
    rows = np.random.default_rng(0).integers(len(given), size=(RESAMPLES, len(given)))
    low, high = np.quantile(given[rows].mean(axis=1), [0.025, 0.975])
    return Interval(float(given.mean()), float(low), float(high))


def has_flattened(curves: npt.ArrayLike) -> bool:
    """Return whether the mean of learning curves (seeds, checkpoints) has stopped to change."""
    mean = np.asarray(curves, np.float64).mean(axis=0)
    quarter = max(len(mean) // 4, 1)
    if len(mean) < 2 * quarter or len(mean) < 4:
        return False
    return bool(abs(mean[-quarter:].mean() - mean[-2 * quarter : -quarter].mean()) <= FLAT)


def verdict(differences: npt.ArrayLike, *, are_flat: bool) -> tuple[Verdict, Interval]:
    """Return what paired differences (one per seed) say about the claim that they are positive.

    Supported if the whole interval is above 0, not supported if it is below, otherwise inconclusive; inconclusive in
    any case if a curve has not flattened.
    """
    interval = bootstrap(differences)
    if not are_flat or interval.low <= 0.0 <= interval.high:
        return "inconclusive", interval
    return ("supported" if interval.low > 0.0 else "not supported"), interval
