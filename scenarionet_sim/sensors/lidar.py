"""A planar lidar: distances to other objects all around."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from scenarionet_data.arrays.dtypes import Array, Int32
from scenarionet_data.scenario.vocabulary import ObjectType
from scenarionet_sim.sensors.base import CompiledSensor, Sensor, add_noise, directions, require, table
from scenarionet_sim.sensors.box_ray_kernels import cast_at_boxes
from scenarionet_sim.sensors.observation_kernels import LIDAR
from scenarionet_sim.worlds.state import State
from scenarionet_sim.worlds.world_batch import WorldBatch


@dataclass(frozen=True)
class Lidar(Sensor):
    """Rays from the agent's centre to the nearest edge of another object's box.

    Observes (rays,) float32 in [0, 1]: the distance as a share of ``range``, 1 without a hit, 0 inside a box.
    Ray k points 2 pi k / rays counter-clockwise from straight ahead and turns with the agent. Nearer boxes occlude
    farther ones; heights are ignored.

    Attributes:
        rays: Number of rays.
        range: Largest distance from the agent's centre [m].
        types: Visible object types, for example ``(ObjectType.PEDESTRIAN,)``; None for all. Use one lidar per type to
            distinguish types.
        noise: Standard deviation of the Gaussian range error [m].
        dropout: Probability that a ray has no return.
    """

    rays: int = 240
    range: float = 50.0
    types: tuple[ObjectType, ...] | None = None
    noise: float = 0.0
    dropout: float = 0.0

    def __post_init__(self) -> None:
        require(self.rays > 0, f"a lidar needs at least one ray, found rays={self.rays}")
        require(self.range > 0, f"a lidar needs a range above 0 m, found range={self.range}")
        require(self.noise >= 0, f"a lidar's noise must be at least 0 m, found noise={self.noise}")
        require(0 <= self.dropout <= 1, f"a lidar's dropout must be a probability, found dropout={self.dropout}")

    @property
    def shape(self) -> tuple[int, ...]:
        """Shape of the observation: (rays,)."""
        return (self.rays,)

    @property
    def compiled(self) -> CompiledSensor | None:
        """A part of the compiled step, unless it is noisy."""
        if self.noise or self.dropout:
            return None
        return CompiledSensor(LIDAR, [self.range], self.rays, table(self.types), directions(self.rays))

    def observe(self, batch: WorldBatch, state: State, agents: Int32, rng: np.random.Generator, out: Array) -> Array:  # noqa: ARG002
        """Write the ranges."""
        seen = state.motion, state.size, state.object_type, state.present, table(self.types)
        cast_at_boxes(agents, *seen, directions(self.rays), self.range, out)
        add_noise(out, self.noise / self.range, self.dropout, rng)
        return out
