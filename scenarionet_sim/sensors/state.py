"""The agent's own motion, and its location on its reference path."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from scenarionet_sim.sensors.base import require
from scenarionet_sim.sensors.compiled import CompiledSensor
from scenarionet_sim.sensors.observation_kernels import OWN_MOTION, SensorForm

WHEELBASE = 0.6
"""Distance between the axles as a share of the length, for the steering angle."""


@dataclass(frozen=True)
class EgoState(CompiledSensor):
    """Steering, heading, velocity and location relative to the reference path.

    Observes (7,) float32 in [-1, 1], each clipped there:

    0. speed forward / ``max_speed``
    1. speed to the left / ``max_speed``
    2. yaw rate / ``max_yaw_rate``, counter-clockwise
    3. steering angle of a bicycle with the agent's yaw rate / (pi / 2); 0 below 0.1 m/s
    4. heading minus the path's / pi; 0 for a path without a direction
    5. distance from the path / ``max_offset``, positive to its left
    6. completed share of the path's length

    Attributes:
        max_speed: [m/s].
        max_yaw_rate: [rad/s].
        max_offset: [m].
    """

    low: ClassVar[float] = -1.0

    max_speed: float = 40.0
    max_yaw_rate: float = 2.0
    max_offset: float = 10.0

    def __post_init__(self) -> None:
        super().__post_init__()
        scales = self.max_speed, self.max_yaw_rate, self.max_offset
        require(min(scales) > 0, f"max_speed, max_yaw_rate and max_offset must be above 0, found {scales}")

    @property
    def shape(self) -> tuple[int, ...]:
        """(7,)."""
        return (7,)

    @property
    def form(self) -> SensorForm:
        """The sensor as kernels take it: factors of the columns, and the wheelbase."""
        full = [self.max_speed, self.max_speed, self.max_yaw_rate, np.pi / 2, np.pi, self.max_offset, 1.0]
        return SensorForm(OWN_MOTION, [*(1.0 / np.array(full)), WHEELBASE])
