"""Actions of agents: steering and throttle."""

from __future__ import annotations

import numpy as np

from scenarionet_data.arrays.dtypes import Float64, Int32
from scenarionet_data.compiled.decorators import kernel
from scenarionet_sim.arrays.minmax import larger, smaller


@kernel(allocates=False)
def place_actions(rows: Int32, given: Float64, actions: Float64) -> int:
    """Take the actions of agents from rows for the first S places of each world, clipped to [-1, 1].

    Args:
        rows: (W, K) row of the agent at each place; -1 at a free one.
        given: (W * S, 2) actions; those for places without an agent are ignored.
        actions: (W * K, 2) output; zero at other places.

    Returns:
        The first row of ``given`` that is not finite, or -1.
    """
    invalid, num_given = -1, len(given) // len(rows)
    for w in range(len(rows) - 1, -1, -1):
        for k in range(rows.shape[1] - 1, -1, -1):
            a, at = w * rows.shape[1] + k, w * num_given + k
            for axis in range(2):
                value = given[at, axis] if k < num_given and rows[w, k] >= 0 else 0.0
                if not np.isfinite(value):
                    invalid = at
                actions[a, axis] = smaller(larger(value, -1.0), 1.0)
    return invalid
