"""Rates of occurrences with Poisson intervals, beside scipy's exact ones."""

from __future__ import annotations

import pytest
from scipy import stats

from scenarionet_data.errors import BadParameter
from scenarionet_data.operations.rates import poisson_rate


@pytest.mark.parametrize("count", [0, 1, 2, 3, 40, 999, 1000, 1001, 30_000])
def test_interval_is_the_exact_one(count):
    """The exact interval (Garwood 1936): quantiles of chi-squared distributions."""
    rate = poisson_rate(count, 20.0)
    assert rate.rate == count / 20
    exact = stats.chi2.ppf(0.025, 2 * count) / 40 if count else 0.0
    tolerance = 1e-9 if count < 1000 else 1e-6
    assert rate.low == pytest.approx(exact, rel=tolerance)
    assert rate.high == pytest.approx(stats.chi2.ppf(0.975, 2 * count + 2) / 40, rel=tolerance)


@pytest.mark.parametrize(("count", "exposure"), [(-1, 1.0), (1, 0.0), (1, float("nan"))])
def test_refuses_what_has_no_rate(count, exposure):
    with pytest.raises(BadParameter, match="wanted a count from 0 on and an exposure above 0"):
        poisson_rate(count, exposure)
