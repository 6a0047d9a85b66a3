"""The quick backend: vehicles as bicycles that go through what they hit; contacts are found all the same."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from scenarionet_data.arrays.dtypes import Float64, Int32
from scenarionet_sim.backends.base import SUBSTEPS, Drive
from scenarionet_sim.kernels.bicycle import drive_bicycles
from scenarionet_sim.worlds.state import State
from scenarionet_sim.worlds.world_batch import WorldBatch


@dataclass(frozen=True)
class Kinematic:
    """A kinematic bicycle model for any number of worlds and agents in one call.

    Attributes:
        drive: What vehicles are capable of.
        grip: The most sideways acceleration [m/s2]; beyond it a vehicle turns less than it is steered.
        substeps: Physics steps in a control step.
    """

    drive: Drive = field(default_factory=Drive)
    grip: float = 8.0
    substeps: int = SUBSTEPS

    def open(self, batch: WorldBatch) -> KinematicSession:
        """A session over the worlds of a batch; it needs nothing of them."""
        del batch
        return KinematicSession(self)


class KinematicSession:
    """Moves agents; remembers nothing."""

    def __init__(self, backend: Kinematic) -> None:
        drive = backend.drive
        numbers = drive.max_steer, drive.acceleration, drive.braking, drive.max_speed, drive.wheelbase, backend.grip
        self._limits = np.array(numbers)
        self._substeps = backend.substeps

    def reset(self, world: int, state: State) -> None:
        """Nothing to forget."""

    def drive(self, state: State, agents: Int32, actions: Float64, dt: float) -> None:
        """Move the agents by one control step, in place; see :class:`scenarionet_sim.backends.base.Session`."""
        arrays = state.size, state.position, state.heading, state.velocity, state.yaw_rate
        drive_bicycles(agents, actions, dt, self._substeps, self._limits, *arrays)

    def close(self) -> None:
        """Nothing to give back."""
