"""Tests of a driver on the batch engine: every scenario of a database once, without exploration."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from scenarionet_data.arrays.dtypes import Float32
from scenarionet_data.errors import LakeError
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
        LakeError: No scenario can be read, or there are agents without a seat: what is left out would depend on how
            fast the others drive, and results of two drivers would be of different agents.
    """
    env = FlatEnv(worlds, environment, seats, seed=0, threads=1)
    env.reset()
    outcomes, drawn, left, present = Outcomes(env.num_agents), worlds, env.num_scenarios, 0
    counts = np.repeat(np.arange(worlds) < left, seats)  # rows in the first episode of a scenario
    controls: Float32 = np.zeros((env.num_agents, 2), np.float32)
    while left > 0:  # each step depends on the one before
        controls[env.masks] = mode(env.observations[env.masks])
        infos = env.step(controls)[4]
        outcomes.add(env, counts)
        for info in infos:
            rows = slice(info["slot"] * seats, (info["slot"] + 1) * seats)
            if counts[rows].all():
                left, present = left - 1, present + info["agents"]
            counts[rows] = drawn < env.num_scenarios
            drawn += 1
    env.close()
    if present != outcomes.episodes:
        raise LakeError(
            f"{present:,} agents drove and {outcomes.episodes:,} had a seat; expected a seat for each, so give as many "
            f"seats as a scenario has vehicles (now {seats})"
        )
    return outcomes
