"""Objects that somebody else drives: the agents of a simulation, moved by its backend with the actions of ``step``."""

from __future__ import annotations

from dataclasses import dataclass

from scenarionet_data.arrays.dtypes import UInt8
from scenarionet_sim.kernels.motion import carry_on
from scenarionet_sim.policies.base import Policy
from scenarionet_sim.policies.objects import ObjectMask, ego
from scenarionet_sim.worlds.state import State
from scenarionet_sim.worlds.world_batch import WorldBatch


@dataclass(frozen=True)
class External(Policy):
    """The simulation's agents.

    An agent appears as recorded at its first valid timestep and stays, whatever the log says later, until it is
    retired (:meth:`scenarionet_sim.simulation.Simulation.retire`).
    """

    objects: ObjectMask = ego

    def advance(self, batch: WorldBatch, now: State, then: State, driver: UInt8, me: int, dt: float) -> None:
        """Puts the agents where they are, for the backend to move; others of its objects appear."""
        del dt
        log = batch.log, batch.num_steps, now.timestep
        moments = *now.motion, now.arc, now.lateral, *then.motion, then.arc, then.lateral
        carry_on(*log, driver, me, 0.0, *moments)
