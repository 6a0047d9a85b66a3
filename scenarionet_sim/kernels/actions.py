"""Actions of agents: steering and throttle."""

from __future__ import annotations

import numpy as np

from scenarionet_data.arrays.compiled import kernel
from scenarionet_data.arrays.dtypes import Float64, Int32


@kernel(allocates=False)
def clip_actions(actions: Float64) -> int:
    """Clip actions (A, 2) to [-1, 1] in place; return the first row with a NaN, or -1."""
    invalid = -1
    for a in range(len(actions) - 1, -1, -1):
        for k in range(2):
            if np.isnan(actions[a, k]):
                invalid = a
            elif actions[a, k] > 1.0:
                actions[a, k] = 1.0
            elif actions[a, k] < -1.0:
                actions[a, k] = -1.0
    return invalid


@kernel(allocates=False)
def actions_by_agent(agents: Int32, row_of: Int32, given: Float64, actions: Float64) -> None:
    """Take the actions of agents from rows.

    Args:
        agents: (A, 2) world and row in it of each agent.
        row_of: (W, N) row of each object in ``given``; -1 without one.
        given: (R, 2) actions.
        actions: (A, 2) output; zero for agents without a row.
    """
    for a in range(len(agents)):
        row = row_of[agents[a, 0], agents[a, 1]]
        for k in range(2):
            actions[a, k] = given[row, k] if row >= 0 else 0.0
