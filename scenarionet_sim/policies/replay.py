"""The log as it was recorded, bit for bit."""

from __future__ import annotations

from dataclasses import dataclass

from scenarionet_data.arrays.dtypes import UInt8
from scenarionet_sim.kernels.motion import replay
from scenarionet_sim.policies.base import Policy
from scenarionet_sim.worlds.state import State
from scenarionet_sim.worlds.world_batch import WorldBatch


@dataclass(frozen=True)
class Replay(Policy):
    """Objects are where they were recorded, and there only while they are valid.

    After the log's last timestep they stand where they are.
    """

    def advance(self, batch: WorldBatch, now: State, then: State, driver: UInt8, me: int, dt: float) -> None:
        """Copies the log's next row."""
        del dt
        replay(batch.log, batch.num_steps, now.timestep, driver, me, *then.motion)
