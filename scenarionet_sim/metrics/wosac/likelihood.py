"""Likelihood of recorded values under the distribution of simulated ones, as WOSAC estimates it.

Source: N. Montali et al., "The Waymo Open Sim Agents Challenge", 2023, section 4, and the challenge's configurations.
R rollouts, E objects, T steps.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from scenarionet_data.arrays.dtypes import Array, Float64, Int64

BERNOULLI_PSEUDOCOUNT = 0.001


@dataclass(frozen=True)
class ScoredFeature:
    """How a feature is scored.

    Attributes:
        weight: Weight in the meta-metric.
        low, high, bins: Range and number of bins of the histogram; values outside count in the outer bins. A truth
            value has the two bins of [-0.5, 1.5].
        pseudocount: Added to each bin's count.
        is_pooled: Compare with the simulated values of all steps, not only of the same step.
        joins_objects: Compare with the simulated values of all objects, as scenario generation does.
    """

    weight: float
    low: float = -0.5
    high: float = 1.5
    bins: int = 2
    pseudocount: float = BERNOULLI_PSEUDOCOUNT
    is_pooled: bool = False
    joins_objects: bool = False


def histogram(low: float, high: float, bins: int, weight: float, *, joins_objects: bool = False) -> ScoredFeature:
    """A feature scored by a histogram over all steps."""
    return ScoredFeature(weight, low, high, bins, 0.1, True, joins_objects)


def log_likelihood(feature: ScoredFeature, recorded: Array, simulated: Array) -> Float64:
    """Logarithm of the likelihood of each recorded value.

    Args:
        feature: Bins and pooling.
        recorded: (E, T).
        simulated: (R, E, T).

    Returns:
        (E, T); -inf in an empty bin without a pseudocount.
    """
    _, objects, steps = simulated.shape
    group = np.zeros((objects, steps), np.int64)  # populations that are estimated separately
    if not feature.joins_objects:
        group += np.arange(objects)[:, None] * (1 if feature.is_pooled else steps)
    if not feature.is_pooled:
        group += np.arange(steps)
    count = int(group.max(initial=-1)) + 1
    cells = group * feature.bins
    counts = np.bincount((_bin(feature, simulated) + cells).ravel(), minlength=count * feature.bins)
    smooth = counts.reshape(count, feature.bins) + feature.pseudocount
    with np.errstate(divide="ignore"):
        logs = np.log(smooth / smooth.sum(axis=1, keepdims=True))
    chosen: Float64 = logs.ravel()[_bin(feature, recorded) + cells]
    return chosen


def _bin(feature: ScoredFeature, values: npt.ArrayLike) -> Int64:
    """Bin of each value. NaN, as a speed at the last step, counts in the last bin, as in the owner's code."""
    edges = np.linspace(feature.low, feature.high, feature.bins + 1).astype(np.float32)
    position = np.searchsorted(edges, np.asarray(values, np.float32), side="right")
    return np.clip(position - 1, 0, feature.bins - 1).astype(np.int64)
