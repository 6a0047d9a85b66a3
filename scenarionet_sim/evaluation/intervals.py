"""Confidence intervals of means: Student's t, whose coverage also holds for few values."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cache
from statistics import NormalDist

import numpy as np
import numpy.typing as npt

from scenarionet_data.arrays.dtypes import Float64

CONFIDENCE = 0.95
_MANY = 1000
"""Degrees of freedom from which the distribution is taken as normal; quantiles differ by less than 0.3 %."""


@dataclass(frozen=True)
class Interval:
    """A mean with its confidence interval."""

    mean: float
    low: float
    high: float

    def __str__(self) -> str:
        return f"{self.mean:.3f} [{self.low:.3f}, {self.high:.3f}]"


def mean_interval(values: npt.ArrayLike, confidence: float = CONFIDENCE) -> Interval:
    """Return the mean of independent values (N,) with its t interval; infinite for a single value."""
    given: Float64 = np.asarray(values, np.float64)
    mean = float(given.mean())
    if len(given) < 2:
        return Interval(mean, -math.inf, math.inf)
    reach = t_quantile(0.5 + 0.5 * confidence, len(given) - 1) * float(given.std(ddof=1)) / math.sqrt(len(given))
    return Interval(mean, mean - reach, mean + reach)


@cache
def t_quantile(probability: float, freedom: int) -> float:
    """Return the quantile of Student's t distribution, for a probability of at least a half.

    The distribution function of t = sqrt(freedom) tan(angle) is a finite sum (Abramowitz and Stegun 26.7.3 and 26.7.4).
    """
    if freedom > _MANY:
        return NormalDist().inv_cdf(probability)
    powers = np.arange(freedom % 2, freedom - 1, 2)  # of the cosine
    factors = np.cumprod(np.where(powers > 1, (powers - 1.0) / np.maximum(powers, 1), 1.0))
    low, high = 0.0, 0.5 * math.pi
    for _ in range(60):  # bisection
        angle = 0.5 * (low + high)
        total = math.sin(angle) * float((factors * math.cos(angle) ** powers).sum())
        share = (angle + total) * 2.0 / math.pi if freedom % 2 else total
        low, high = (angle, high) if 0.5 + 0.5 * share < probability else (low, angle)
    return math.sqrt(freedom) * math.tan(angle)
