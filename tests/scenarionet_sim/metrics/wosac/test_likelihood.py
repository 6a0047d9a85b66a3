"""Likelihoods under histograms, with the owner's cases."""

from __future__ import annotations

import numpy as np
import pytest

from scenarionet_sim.metrics.wosac.likelihood import ScoredFeature, histogram, log_likelihood

UNIT = histogram(0.0, 1.0, 10, 1.0)


@pytest.mark.parametrize("is_pooled", [False, True])
@pytest.mark.parametrize("joins_objects", [False, True])
def test_one_value_for_each_object_and_step(is_pooled: bool, joins_objects: bool):
    feature = ScoredFeature(1.0, 0.0, 1.0, 10, 0.1, is_pooled, joins_objects)
    assert log_likelihood(feature, np.zeros((4, 80)), np.zeros((32, 4, 80))).shape == (4, 80)


def test_what_is_pooled():
    """Two objects, two steps, two rollouts; every population is known by hand."""
    simulated = np.array([[[0.05, 0.15], [0.25, 0.35]], [[0.05, 0.15], [0.25, 0.35]]])
    recorded = np.array([[0.05, 0.05], [0.05, 0.25]])

    def likelihood(is_pooled: bool, joins_objects: bool) -> list[list[float]]:
        feature = ScoredFeature(1.0, 0.0, 1.0, 10, 0.0, is_pooled, joins_objects)
        return np.exp(log_likelihood(feature, recorded, simulated)).tolist()

    assert likelihood(False, False) == [[1.0, 0.0], [0.0, 0.0]]
    assert likelihood(True, False) == [[0.5, 0.5], [0.0, 0.5]]
    assert likelihood(False, True) == [[0.5, 0.0], [0.5, 0.0]]
    assert likelihood(True, True) == [[0.25, 0.25], [0.25, 0.25]]


def test_uniform_and_normal_samples():
    rng = np.random.default_rng(0)
    simulated = np.stack([rng.uniform(size=10_000), rng.normal(0.5, 0.2, 10_000)], axis=1)[:, :, None]
    logs = [log_likelihood(UNIT, np.full((2, 1), value), simulated)[:, 0] for value in (0.0, 0.15, 0.5, 1.0)]
    uniform, normal = np.array(logs).T
    assert uniform == pytest.approx(np.full(4, np.log(0.1)), abs=0.1)
    assert int(normal.argmax()) == 2


@pytest.mark.parametrize(("pseudocount", "expected"), [(0.0, 0.0), (1.0, 1 / 14)])
def test_pseudocount_of_an_empty_bin(pseudocount: float, expected: float):
    feature = ScoredFeature(1.0, 0.0, 1.0, 10, pseudocount)
    simulated = np.array([0.0, 0.0, 0.0, 1.0])[:, None, None]
    assert np.exp(log_likelihood(feature, np.array([[0.5]]), simulated)) == pytest.approx(expected)


def test_truth_values():
    simulated = np.array([[0, 1, 0, 1, 1], [0, 1, 0, 1, 0], [0, 1, 0, 1, 0], [0, 1, 0, 1, 0]], bool)[..., None]
    recorded = np.array([[0], [1], [1], [0], [1]], bool)
    found = np.exp(log_likelihood(ScoredFeature(1.0), recorded, simulated))[:, 0]
    assert found == pytest.approx([1, 1, 0, 0, 0.25], abs=1e-2)


def test_values_outside_the_range_count_in_the_outer_bins():
    simulated = np.array([-3.0, 7.0, 7.0, np.nan])[:, None, None]
    feature = ScoredFeature(1.0, 0.0, 1.0, 10, 0.0)
    assert np.exp(log_likelihood(feature, np.array([[-9.0]]), simulated)) == pytest.approx(0.25)
    assert np.exp(log_likelihood(feature, np.array([[9.0]]), simulated)) == pytest.approx(0.75)
