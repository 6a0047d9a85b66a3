"""Compiled loop of the validation of tracks."""

from __future__ import annotations

import numpy as np

from scenarionet_data.arrays.dtypes import Array
from scenarionet_data.compiled.decorators import kernel


@kernel
def count_faults(values: Array, valid: Array) -> tuple[int, int]:
    """Count values that are not finite, and others that are not 0 at invalid states.

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
