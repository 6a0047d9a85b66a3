"""The agents of a simulation, driven by the actions of ``step``."""

from __future__ import annotations

from dataclasses import dataclass

from scenarionet_data.arrays.dtypes import UInt8
from scenarionet_sim.kernels.motion import replay
from scenarionet_sim.policies.base import Policy
from scenarionet_sim.policies.objects import ObjectMask, ego
from scenarionet_sim.worlds.state import State
from scenarionet_sim.worlds.world_batch import WorldBatch


@dataclass(frozen=True)
class External(Policy):
    """Objects driven by actions, through the backend.

    An agent appears as recorded at its first valid timestep and stays, independent of the log, until it is retired
    (:meth:`scenarionet_sim.simulation.Simulation.retire`).
    """

    objects: ObjectMask = ego

    def advance(self, batch: WorldBatch, now: State, then: State, driver: UInt8, policy_id: int, dt: float) -> None:
        """Let agents appear; the backend moves those that are present."""
        del dt
        replay(batch.log, batch.num_steps, now.timestep, driver, policy_id, True, then.motion, then.present)
