"""Constant velocity, the simplest baseline."""

from __future__ import annotations

from dataclasses import dataclass

from scenarionet_data.arrays.dtypes import UInt8
from scenarionet_sim.kernels.motion import move_on
from scenarionet_sim.policies.base import Policy
from scenarionet_sim.worlds.state import State
from scenarionet_sim.worlds.world_batch import WorldBatch


@dataclass(frozen=True)
class ConstantVelocity(Policy):
    """Objects keep the velocity and heading at which they appear, and never leave."""

    def advance(self, batch: WorldBatch, now: State, then: State, driver: UInt8, policy_id: int, dt: float) -> None:
        """Move each object by its velocity."""
        log, num_steps = batch.log, batch.num_steps
        move_on(log, num_steps, now.timestep, driver, policy_id, dt, then.motion, then.present)
