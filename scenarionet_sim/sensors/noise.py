"""Range errors and drop-outs of rays."""

from __future__ import annotations

import numpy as np

from scenarionet_data.arrays.dtypes import Float32


def add_noise(shares: Float32, spread: float, dropout: float, rng: np.random.Generator) -> None:
    """Add noise to ranges in place.

    Args:
        shares: Ranges divided by the sensor's range, in [0, 1].
        spread: Standard deviation of the Gaussian error, divided by the range; results are clipped to [0, 1].
        dropout: Probability that a ray has no return.
        rng: Source of noise; unused when both are 0.
    """
    if spread > 0.0:
        shares += spread * rng.standard_normal(shares.shape, np.float32)
        np.clip(shares, 0.0, 1.0, out=shares)
    if dropout > 0.0:
        shares[rng.random(shares.shape, np.float32) < dropout] = 1.0
