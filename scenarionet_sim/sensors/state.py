"""What an agent knows of itself: how it moves, and where it is on its own path."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import ClassVar

import numpy as np

from scenarionet_data.arrays.dtypes import Array, Float64, Int32
from scenarionet_sim.kernels.route_observation import observe_self
from scenarionet_sim.sensors.base import Sensor, require, require_arcs
from scenarionet_sim.worlds.state import State
from scenarionet_sim.worlds.world_batch import WorldBatch

WHEELBASE = 0.6
"""Between the axles, as a share of the length: what a steering angle is derived with."""


@dataclass(frozen=True)
class EgoState(Sensor):
    """Steering, heading, velocity and place relative to the reference path.

    Observes (7,) float32 in [-1, 1], each clipped there:

    0. speed forward / ``max_speed``
    1. speed to the left / ``max_speed``
    2. yaw rate / ``max_yaw_rate``, counter-clockwise
    3. angle of the front wheels of a bicycle that turns as the agent does / (pi / 2); 0 below 0.1 m/s
    4. heading minus the path's / pi; 0 for a path without a direction
    5. distance from the path / ``max_offset``, positive to its left
    6. share of the path's length that is done

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
        require(min(scales) > 0, f"max_speed, max_yaw_rate and max_offset are above 0, found {scales}")

    @property
    def shape(self) -> tuple[int, ...]:
        """(7,)."""
        return (7,)

    def observe(self, batch: WorldBatch, state: State, agents: Int32, rng: np.random.Generator, out: Array) -> Array:  # noqa: ARG002
        """See the class."""
        require_arcs(state, agents)
        motion = state.heading, state.velocity, state.yaw_rate, state.size, state.arc, state.lateral
        paths = batch.path_points, batch.path_arc, batch.path_heading, batch.path_z, batch.path_offsets
        observed = np.empty((len(agents), 7))
        observe_self(agents, *motion, *paths, WHEELBASE, observed)
        np.multiply(observed, self._shares, out=out, casting="same_kind")
        np.minimum(out, 1.0, out=out)  # np.clip takes three times as long for so few numbers
        return np.maximum(out, -1.0, out=out)

    @cached_property
    def _shares(self) -> Float64:
        """(7,) what the columns are multiplied with."""
        full = [self.max_speed, self.max_speed, self.max_yaw_rate, np.pi / 2, np.pi, self.max_offset, 1.0]
        return 1.0 / np.array(full)
