"""Tests of a driver on the batch engine: every scenario of a database once, without exploration."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from scenarionet_data.arrays.dtypes import Float32
from scenarionet_sim.environments.config import EnvConfig
from scenarionet_sim.environments.flat import FlatEnv
from scenarionet_sim.learning.rows import Outcomes

ActionMode = Callable[[Float32], Float32]
"""Maps observations (B, D) to controls (B, 2) in [-1, 1], without chance."""


def drive_each(environment: EnvConfig, mode: ActionMode, worlds: int, seats: int = 1) -> Outcomes:
    """Drive once through every scenario of an environment whose order is sequential.

    Args:
        environment: The environment.
        mode: The driver.
        worlds: Worlds that step together.
        seats: Agents of a world.

    Returns:
        Outcomes of the agents.

    Raises:
        LakeError: No scenario can be read.
    """
    env = FlatEnv(worlds, environment, seats, seed=0, threads=1)
    env.reset()
    outcomes, drawn, left = Outcomes(env.num_agents), worlds, env.num_scenarios
    counts = np.repeat(np.arange(worlds) < left, seats)  # rows in the first episode of a scenario
    while left > 0:  # each step depends on the one before
        infos = env.step(mode(env.observations))[4]
        outcomes.add(env, counts)
        for info in infos:
            rows = slice(info["slot"] * seats, (info["slot"] + 1) * seats)
            left -= bool(counts[rows].all())
            counts[rows] = drawn < env.num_scenarios
            drawn += 1
    env.close()
    return outcomes
