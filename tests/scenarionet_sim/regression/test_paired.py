"""Paired tests by hand, and against SciPy."""

from __future__ import annotations

import math

import numpy as np
import pytest

from scenarionet_sim.regression.paired import corrected, paired_interval, paired_p_value, scenarios_needed

stats = pytest.importorskip("scipy.stats")


def test_by_hand():
    # Of 2^3 = 8 choices of signs of 1, 2, 4 only all plus and all minus reach 7; 5 is reached by +-(1, 4) with -+2 too.
    assert paired_p_value(np.array([1.0, 2.0, 4.0])) == 2 / 8
    assert paired_p_value(np.array([-1.0, 2.0, 4.0, 0.0])) == 4 / 8
    assert paired_p_value(np.zeros(9)) == 1.0
    # McNemar: 1 of 6 the other way: 2 (1 + 6) / 2^6.
    assert paired_p_value(np.array([1.0, -1, -1, -1, -1, -1, 0, 0])) == 14 / 64
    assert paired_p_value(np.array([1.0, -1])) == 1.0


def test_as_scipy():
    rng = np.random.default_rng(0)
    for down, up in ((3, 17), (40, 61), (600, 700)):
        differences = np.repeat([-0.5, 0.5, 0.0], [down, up, 100])
        assert paired_p_value(differences) == pytest.approx(stats.binomtest(up, up + down).pvalue, rel=1e-9)

    def exactly(values, **how):
        return stats.permutation_test((values,), np.sum, permutation_type="samples", **how).pvalue

    few = rng.normal(0.5, 1.0, 11)
    assert paired_p_value(few) == pytest.approx(exactly(few, n_resamples=np.inf), rel=1e-9)
    some = rng.normal(0.2, 1.0, 100)
    expected = stats.ttest_1samp(some, 0.0).pvalue
    assert paired_p_value(some) == pytest.approx(expected, abs=4 * math.sqrt(expected / 19_999) + 0.005)
    many = np.concatenate([rng.normal(0.03, 1.0, 4000), np.zeros(6000)])
    assert paired_p_value(many) == pytest.approx(stats.ttest_1samp(many, 0.0).pvalue, rel=0.02)


def test_corrected_for_their_number_as_by_holm():
    # Sorted 0.01, 0.02, 0.03, 0.5 by 4, 3, 2, 1: 0.04, 0.06, 0.06 (not less than the one before), 0.5.
    assert corrected([0.02, 0.5, 0.01, 0.03]) == pytest.approx([0.06, 0.5, 0.04, 0.06])
    assert corrected([0.6, 0.7]) == [1.0, 1.0] and corrected([]) == []


def test_intervals():
    rng = np.random.default_rng(1)
    values = rng.normal(0.1, 1.0, 25)
    found = paired_interval(values)
    expected = stats.t.interval(0.95, 24, values.mean(), stats.sem(values))
    assert (found.mean, found.low, found.high) == pytest.approx((values.mean(), *expected), rel=1e-6)
    # Bonett and Price (2012): of 98, 5 up and 1 down: (6 - 2) / 100 +- 1.96 sqrt((0.08 - 0.04^2) / 100).
    found = paired_interval(np.repeat([1.0, -1.0, 0.0], [5, 1, 92]))
    reach = 1.959964 * math.sqrt((0.08 - 0.0016) / 100)
    assert (found.mean, found.low, found.high) == pytest.approx((4 / 98, 0.04 - reach, 0.04 + reach), rel=1e-6)
    assert paired_interval(np.zeros(100)).high > 0.01, "that nothing differs in 100 scenarios is no proof"
    assert scenarios_needed(-0.04, 0.04, 100, 0.02) == 400


@pytest.mark.parametrize(("share", "size"), [(0.03, 100), (0.3, 100), (1.0, 30)])
def test_false_alarms_are_as_rare_as_promised(share, size):
    """Differences of two alike policies, rare and heavy-tailed: of 400 comparisons at 5 %, 20 expected."""
    rng, alarms = np.random.default_rng(2), 0
    for _ in range(400):
        both = rng.beta(0.5, 0.2, (2, size))
        alarms += paired_p_value(np.where(rng.random(size) < share, both[1] - both[0], 0.0)) < 0.05
    assert alarms <= stats.binom.ppf(0.999, 400, 0.05)
