"""Imperfect rays: errors of range, and rays that come back empty."""

from __future__ import annotations

import numpy as np

from scenarionet_data.arrays.dtypes import Float32


def add_noise(shares: Float32, spread: float, dropout: float, rng: np.random.Generator) -> None:
    """Disturb ranges in place.

    Args:
        shares: Ranges as shares of the sensor's, in [0, 1].
        spread: Standard deviation of a Gaussian error, as a share; the result is kept in [0, 1].
        dropout: Probability that a ray sees nothing, whatever is there.
        rng: Left alone when there is nothing to disturb.
    """
    if spread > 0.0:
        shares += spread * rng.standard_normal(shares.shape, np.float32)
        np.clip(shares, 0.0, 1.0, out=shares)
    if dropout > 0.0:
        shares[rng.random(shares.shape, np.float32) < dropout] = 1.0
