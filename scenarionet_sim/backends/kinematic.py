"""Kinematic backend: bicycle model without collision response; contacts are still detected."""

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
        grip: Largest lateral acceleration [m/s²]; beyond it a vehicle understeers.
        substeps: Physics steps per control step.
    """

    drive: Drive = field(default_factory=Drive)
    grip: float = 8.0
    substeps: int = SUBSTEPS

    def open(self, batch: WorldBatch) -> KinematicSession:
        """Open a session; it is independent of the batch."""
        del batch
        return KinematicSession(self)


class KinematicSession:
    """Stateless session; the compiled step drives by ``limits`` and ``substeps`` itself.

    Attributes:
        limits: (6,) see ``kernels.bicycle``.
        substeps: Physics steps per control step.
    """

    def __init__(self, backend: Kinematic) -> None:
        drive = backend.drive
        numbers = drive.max_steer, drive.acceleration, drive.braking, drive.max_speed, drive.wheelbase, backend.grip
        self.limits = np.array(numbers)
        self.substeps = backend.substeps

    def reset(self, world: int, state: State) -> None:
        """Do nothing: the session is stateless."""

    def drive(self, state: State, agents: Int32, actions: Float64, dt: float) -> None:
        """Move the agents by one control step, in place; see :class:`scenarionet_sim.backends.base.Session`."""
        drive_bicycles(agents, actions, dt, self.substeps, self.limits, state.size, state.motion)

    def close(self) -> None:
        """Do nothing: the session holds no resources."""
