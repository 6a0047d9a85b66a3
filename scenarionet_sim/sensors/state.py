"""The agent's own motion, and its location on its reference path."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import ClassVar

import numpy as np

from scenarionet_data.arrays.dtypes import Array, Float64, Int32
from scenarionet_sim.sensors.base import CompiledSensor, Sensor, require, require_located
from scenarionet_sim.sensors.observation_kernels import OWN_MOTION
from scenarionet_sim.sensors.route_kernels import observe_self
from scenarionet_sim.worlds.state import State
from scenarionet_sim.worlds.world_batch import WorldBatch

WHEELBASE = 0.6
"""Distance between the axles as a share of the length, for the steering angle."""


@dataclass(frozen=True)
class EgoState(Sensor):
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
        scales = self.max_speed, self.max_yaw_rate, self.max_offset
        require(min(scales) > 0, f"max_speed, max_yaw_rate and max_offset must be above 0, found {scales}")

    @property
    def shape(self) -> tuple[int, ...]:
        """(7,)."""
        return (7,)

    @property
    def compiled(self) -> CompiledSensor:
        """A part of the compiled step."""
        return CompiledSensor(OWN_MOTION, [*self._scale, WHEELBASE])

    def observe(self, batch: WorldBatch, state: State, agents: Int32, rng: np.random.Generator, out: Array) -> Array:  # noqa: ARG002
        """Write the seven values."""
        observed = np.empty((len(agents), 7))
        own = state.motion, state.route, state.size
        lost = observe_self(agents, *own, batch.recorded, WHEELBASE, observed)
        require_located(lost, agents)
        np.multiply(observed, self._scale, out=out, casting="same_kind")
        np.minimum(out, 1.0, out=out)  # np.clip is three times slower for so few values
        return np.maximum(out, -1.0, out=out)

    @cached_property
    def _scale(self) -> Float64:
        """(7,) factors of the columns."""
        full = [self.max_speed, self.max_speed, self.max_yaw_rate, np.pi / 2, np.pi, self.max_offset, 1.0]
        return 1.0 / np.array(full)
