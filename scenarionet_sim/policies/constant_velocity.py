"""Straight on: the simplest prediction, and a baseline."""

from __future__ import annotations

from dataclasses import dataclass

from scenarionet_data.arrays.dtypes import UInt8
from scenarionet_sim.kernels.motion import carry_on
from scenarionet_sim.policies.base import Policy
from scenarionet_sim.worlds.state import State
from scenarionet_sim.worlds.world_batch import WorldBatch


@dataclass(frozen=True)
class ConstantVelocity(Policy):
    """Objects keep the velocity and heading they have when they appear, and stay."""

    def advance(self, batch: WorldBatch, now: State, then: State, driver: UInt8, me: int, dt: float) -> None:
        """Moves each by its velocity."""
        log = batch.log, batch.num_steps, now.timestep
        moments = *now.motion, now.arc, now.lateral, *then.motion, then.arc, then.lateral
        carry_on(*log, driver, me, dt, *moments)
