"""Tests and intervals of paired differences, one for each scenario, whose rollouts are averaged before."""

from __future__ import annotations

import math
from collections.abc import Sequence
from statistics import NormalDist

import numpy as np

from scenarionet_data.arrays.dtypes import Float64
from scenarionet_sim.evaluation.intervals import CONFIDENCE, Interval, mean_interval

_EXACT = 14  # differences up to which every choice of signs is looked at
_MANY = 2000  # from which the sum is taken as normal
_DRAWS = 19_999


def paired_p_value(differences: Float64, seed: int = 0) -> float:
    """Return the two-sided p-value of no difference, by the signs that the differences could have had as well.

    If old and new do not differ, each difference has either sign with the same probability (Fisher's randomisation
    test). Of yes and no it is McNemar's exact test. Few differences that are not 0 are enumerated, up to 2,000 are
    drawn with (hits + 1) / (draws + 1) (Phipson and Smyth 2010), and more are normal.

    Args:
        differences: (N,) new minus old of independent scenarios.
        seed: Of the draws.
    """
    sizes = np.abs(differences[differences != 0.0])
    count, observed = len(sizes), abs(float(differences.sum()))
    if not count:
        return 1.0
    if np.ptp(sizes) == 0.0:
        fewer = min(int((differences > 0.0).sum()), int((differences < 0.0).sum()))
        chosen = sum(math.comb(count, k) for k in range(fewer + 1))
        return min(1.0, chosen / (1 << count - 1))
    reached = observed * (1.0 - 1e-9)
    if count <= _EXACT:
        signs = 1.0 - 2.0 * (np.arange(2**count)[:, None] >> np.arange(count) & 1)
        return float((np.abs(signs @ sizes) >= reached).mean())
    if count > _MANY:
        return 2.0 * NormalDist().cdf(-observed / math.sqrt(float((sizes**2).sum())))
    rng, hits = np.random.default_rng(seed), 0
    for _ in range(_DRAWS // 2857):
        signs = 1.0 - 2.0 * rng.integers(0, 2, (2857, count))
        hits += int((np.abs(signs @ sizes) >= reached).sum())
    return (hits + 1) / (_DRAWS + 1)


def corrected(p_values: Sequence[float]) -> list[float]:
    """Return p-values of several tests, corrected by Holm (1979): the share of families with a false alarm holds."""
    order, found, largest = np.argsort(p_values), [0.0] * len(p_values), 0.0
    for place, number in enumerate(order.tolist()):
        largest = max(largest, min(1.0, (len(p_values) - place) * p_values[number]))
        found[number] = largest
    return found


def paired_interval(differences: Float64) -> Interval:
    """Return the mean of the differences (N,) with its 95 % interval.

    Of yes and no, where all are -1, 0 or 1, it is that of Bonett and Price (2012), which is not empty where nothing
    differs; otherwise that of Student's t.
    """
    if not np.isin(differences, (-1.0, 0.0, 1.0)).all():
        return mean_interval(differences)
    count = len(differences)
    up, down = (((differences == sign).sum() + 1.0) / (count + 2.0) for sign in (1.0, -1.0))
    z = NormalDist().inv_cdf(0.5 + 0.5 * CONFIDENCE)
    middle, reach = up - down, z * math.sqrt((up + down - (up - down) ** 2) / (count + 2.0))
    return Interval(float(differences.mean()), max(middle - reach, -1.0), min(middle + reach, 1.0))


def scenarios_needed(low: float, high: float, scenarios: int, margin: float) -> int:
    """Return about how many scenarios would have an interval within the margin, if the mean is 0.

    Args:
        low, high: The interval of so many scenarios.
        scenarios: Their number.
        margin: Half the width of the interval that is wanted.
    """
    return math.ceil(scenarios * ((high - low) / (2.0 * margin)) ** 2)
