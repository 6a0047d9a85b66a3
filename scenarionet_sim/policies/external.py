"""The agents of a simulation, driven by the actions of ``step``."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from scenarionet_sim.policies.base import Policy
from scenarionet_sim.policies.motion_kernels import ENTER
from scenarionet_sim.policies.objects import ObjectMask, ego


@dataclass(frozen=True)
class External(Policy):
    """Objects driven by actions, through the backend.

    An agent appears as recorded at its first valid timestep and stays, independent of the log, until it is retired
    (:meth:`scenarionet_sim.simulation.simulation.Simulation.retire`).
    """

    movement: ClassVar[int] = ENTER

    objects: ObjectMask = ego
