"""What moves, at one moment of one world: from its recording, or from a simulation."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from scenarionet_sim.worlds.state import State
from scenarionet_sim.worlds.world import World

Bool = npt.NDArray[np.bool_]
Float64 = npt.NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Moment:
    """N objects of a world, row by row.

    Attributes:
        timestep: Since the recording's beginning; past its end the lights show what they showed last.
        position: (N, 2) float64 [m].
        heading: (N,) float64 [rad].
        present: (N,) bool.
    """

    timestep: int
    position: Float64
    heading: Float64
    present: Bool

    @classmethod
    def recorded(cls, world: World, timestep: int) -> Moment:
        """As the log has it."""
        position, heading = world.log_position[timestep], world.log_heading[timestep]
        return cls(timestep, position.astype(np.float64), heading.astype(np.float64), world.log_valid[timestep])

    @classmethod
    def simulated(cls, world: World, state: State, slot: int = 0) -> Moment:
        """As a simulation has it now; a copy."""
        here = slice(0, world.num_objects)
        position, heading = state.position[slot, here].copy(), state.heading[slot, here].copy()
        return cls(int(state.timestep[slot]), position, heading, state.present[slot, here].copy())
