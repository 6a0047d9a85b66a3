"""Compiled loop of the validation of tracks."""

from __future__ import annotations

import numpy as np
from numba import njit

from scenarionet_data.arrays.dtypes import Array


@njit(cache=True)
def count_faults(values: Array, valid: Array) -> tuple[int, int]:
    """Count values that are NaN or infinite, and finite values that are not 0 where ``valid`` is False.

    Args:
        values: (N, T, D) float32.
        valid: (N, T) bool.
    """
    num_not_finite, num_set = 0, 0
    for row in range(values.shape[0]):
        for step in range(values.shape[1]):
            for axis in range(values.shape[2]):
                value = values[row, step, axis]
                if not np.isfinite(value):
                    num_not_finite += 1
                elif value != 0 and not valid[row, step]:
                    num_set += 1
    return num_not_finite, num_set
