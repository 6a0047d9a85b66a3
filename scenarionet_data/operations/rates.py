"""How often something happens: counts per distance and time, with Poisson intervals."""

from __future__ import annotations

import math
from statistics import NormalDist
from typing import NamedTuple

import numpy as np

from scenarionet_data.errors import BadParameter

_MANY = 1000


class Rate(NamedTuple):
    """Occurrences per unit of exposure, with an interval of their expectation."""

    rate: float
    low: float
    high: float


def poisson_rate(count: int, exposure: float, confidence: float = 0.95) -> Rate:
    """Return the rate of a Poisson process and the exact interval of it (Garwood 1936).

    Its ends are the expectations at which so many occurrences or more, and so many or fewer, have half the remaining
    probability. From 1,000 occurrences on, Byar's approximation is within 1e-6 of them (Breslow and Day 1987,
    Statistical Methods in Cancer Research II, p. 69).

    Args:
        count: Number of occurrences.
        exposure: Distance or time that was observed, in any unit.
        confidence: Probability that the interval covers the expectation.

    Raises:
        BadParameter: The count is negative, or the exposure is not positive.
    """
    if count < 0 or not exposure > 0:
        raise BadParameter(f"{count} occurrences in {exposure}: wanted a count from 0 on and an exposure above 0")
    tail = (1 - confidence) / 2
    low = _expectation(count - 1, 1 - tail) if count else 0.0
    return Rate(count / exposure, low / exposure, _expectation(count, tail) / exposure)


def _expectation(count: int, probability: float) -> float:
    """Return the expectation at which a Poisson process has at most ``count`` occurrences with a probability."""
    if count >= _MANY:
        n = count + 1
        return float(n * (1 - 1 / (9 * n) - NormalDist().inv_cdf(probability) / (3 * n**0.5)) ** 3)
    factorials = np.cumsum(np.log(np.arange(1, count + 1)))
    logs = np.append(0.0, factorials)
    low, high = 0.0, count + 10.0 * math.sqrt(count + 10)
    for _ in range(100):
        middle = (low + high) / 2
        at_most = float(np.exp(np.arange(count + 1) * np.log(middle) - middle - logs).sum())
        low, high = (middle, high) if at_most > probability else (low, middle)
    return (low + high) / 2
