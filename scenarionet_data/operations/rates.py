"""How often something happens: counts per distance and time, with Poisson intervals."""

from __future__ import annotations

from statistics import NormalDist
from typing import NamedTuple

from scenarionet_data.errors import BadParameter


class Rate(NamedTuple):
    """Occurrences per unit of exposure, with an interval of their expectation."""

    rate: float
    low: float
    high: float


def poisson_rate(count: int, exposure: float, confidence: float = 0.95) -> Rate:
    """Return the rate of a Poisson process and an interval of it, by Byar's approximation of the exact interval.

    Source: Breslow and Day (1987), Statistical Methods in Cancer Research II, p. 69. The lower end is too low by
    half for one occurrence, by 8 % for two, and less than 3 % from three on; the upper end is within 1 %.

    Args:
        count: Number of occurrences.
        exposure: Distance or time that was observed, in any unit.
        confidence: Probability that the interval covers the expectation.

    Raises:
        BadParameter: The count is negative, or the exposure is not positive.
    """
    if count < 0 or not exposure > 0:
        raise BadParameter(f"{count} occurrences in {exposure}: wanted a count from 0 on and an exposure above 0")
    z = NormalDist().inv_cdf((1 + confidence) / 2)
    low = count * (1 - 1 / (9 * count) - z / (3 * count**0.5)) ** 3 if count else 0.0
    high = (count + 1) * (1 - 1 / (9 * (count + 1)) + z / (3 * (count + 1) ** 0.5)) ** 3
    return Rate(count / exposure, low / exposure, high / exposure)
