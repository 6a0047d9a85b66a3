"""Confidence intervals: quantiles against published tables, coverage by simulation."""

from __future__ import annotations

import math

import numpy as np
import pytest

from scenarionet_sim.evaluation.intervals import mean_interval, t_quantile

TABLE = {1: 12.7062, 2: 4.3027, 3: 3.1824, 4: 2.7764, 5: 2.5706, 9: 2.2622, 10: 2.2281, 30: 2.0423, 1000: 1.9623}
"""Quantiles of 0.975 by degrees of freedom, as in every textbook."""


@pytest.mark.parametrize(("freedom", "expected"), TABLE.items())
def test_quantiles_are_those_of_the_table(freedom, expected):
    assert t_quantile(0.975, freedom) == pytest.approx(expected, abs=1e-4)
    assert t_quantile(0.5, freedom) == pytest.approx(0.0, abs=1e-9)


def test_quantiles_of_other_probabilities_and_of_many_values():
    assert t_quantile(0.995, 4) == pytest.approx(4.6041, abs=1e-4)
    assert t_quantile(0.9, 3) == pytest.approx(1.6377, abs=1e-4)
    assert t_quantile(0.975, 5000) == pytest.approx(1.95996, abs=1e-4)


def test_an_interval_by_hand():
    found = mean_interval([1.0, 2.0, 3.0])  # deviation 1
    reach = 4.3027 / math.sqrt(3.0)
    assert (found.mean, found.low, found.high) == pytest.approx((2.0, 2.0 - reach, 2.0 + reach), abs=1e-4)
    assert str(mean_interval([0.5] * 5)) == "0.500 [0.500, 0.500]"
    assert mean_interval([1.0]).high == math.inf


@pytest.mark.parametrize("count", [3, 5, 10])
@pytest.mark.parametrize("kind", ["normal", "shares", "seeds and scenarios"])
def test_nineteen_of_twenty_intervals_have_the_mean(count, kind):
    """Of 4,000 experiments with normal values, with shares of 50 scenarios in which 80 % succeed, and with differences
    of two drivers by seeds, which are of uneven success and have 32 scenarios of their own each: 95 +- 2 %.
    """
    rng = np.random.default_rng(0)
    drawn = rng.normal(size=(4000, count)) if kind == "normal" else rng.binomial(50, 0.8, (4000, count)) / 50.0
    if kind == "seeds and scenarios":
        success = rng.beta([8.0, 16.0], [4.0, 4.0], (4000, count, 2))
        drawn = (rng.random((4000, count, 32, 1)) < success[:, :, None]).mean(axis=2) @ [-1.0, 1.0]
    mean = {"normal": 0.0, "shares": 0.8}.get(kind, 16.0 / 20.0 - 8.0 / 12.0)
    found = [mean_interval(values) for values in drawn]
    assert np.mean([each.low <= mean <= each.high for each in found]) == pytest.approx(0.95, abs=0.02)
