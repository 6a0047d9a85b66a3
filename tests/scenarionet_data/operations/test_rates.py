"""Rates of occurrences with Poisson intervals, beside scipy's exact ones."""

from __future__ import annotations

import pytest
from scipy import stats

from scenarionet_data.errors import BadParameter
from scenarionet_data.operations.rates import poisson_rate


@pytest.mark.parametrize(("count", "too_low"), [(0, 0), (1, 0.5), (2, 0.08), (3, 0.03), (40, 0.001), (1000, 0.0001)])
def test_interval_is_near_the_exact_one(count, too_low):
    """The exact interval (Garwood 1936): quantiles of chi-squared distributions."""
    rate = poisson_rate(count, 20.0)
    assert rate.rate == count / 20
    exact = stats.chi2.ppf(0.025, 2 * count) / 40 if count else 0.0
    assert (1 - too_low) * exact <= rate.low <= exact
    assert rate.high == pytest.approx(stats.chi2.ppf(0.975, 2 * count + 2) / 40, rel=0.01)


@pytest.mark.parametrize(("count", "exposure"), [(-1, 1.0), (1, 0.0), (1, float("nan"))])
def test_refuses_what_has_no_rate(count, exposure):
    with pytest.raises(BadParameter, match="wanted a count from 0 on and an exposure above 0"):
        poisson_rate(count, exposure)
