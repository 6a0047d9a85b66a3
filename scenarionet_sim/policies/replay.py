"""Replay of the log, bit for bit."""

from __future__ import annotations

from dataclasses import dataclass

from scenarionet_data.arrays.dtypes import UInt8
from scenarionet_sim.kernels.motion import replay
from scenarionet_sim.policies.base import Policy
from scenarionet_sim.worlds.state import State
from scenarionet_sim.worlds.world_batch import WorldBatch


@dataclass(frozen=True)
class Replay(Policy):
    """Objects follow their recorded states and are present only while those are valid.

    After the end of the log they are at rest.
    """

    def advance(self, batch: WorldBatch, now: State, then: State, driver: UInt8, policy_id: int, dt: float) -> None:
        """Copy the next row of the log."""
        del dt
        replay(batch.log, batch.num_steps, now.timestep, driver, policy_id, False, then.motion, then.present)
