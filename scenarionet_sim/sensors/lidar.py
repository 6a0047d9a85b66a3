"""A lidar in the plane: how far it is to other objects, all around."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from scenarionet_data.arrays.dtypes import Array, Int32
from scenarionet_data.scenario.vocabulary import ObjectType
from scenarionet_sim.kernels.rays import cast_at_boxes
from scenarionet_sim.sensors.base import Sensor, directions, require, table
from scenarionet_sim.sensors.noise import add_noise
from scenarionet_sim.worlds.state import State
from scenarionet_sim.worlds.world_batch import WorldBatch


@dataclass(frozen=True)
class Lidar(Sensor):
    """Rays from the agent's centre to the nearest edge of another object's box.

    Observes (rays,) float32 in [0, 1]: the distance as a share of ``range``, 1 where nothing is in reach, 0 inside
    a box. Ray k points 2 pi k / rays counter-clockwise from straight ahead and turns with the agent. Boxes are seen
    through one another only by the rays that miss the nearer one; heights do not matter.

    Attributes:
        rays: Number of rays.
        range: [m] from the agent's centre.
        types: What is seen, for example ``(ObjectType.PEDESTRIAN,)``; None: everything. Several lidars of one type
            each tell the types apart.
        noise: Standard deviation of a Gaussian error of the distance [m].
        dropout: Probability that a ray sees nothing.
    """

    rays: int = 240
    range: float = 50.0
    types: tuple[ObjectType, ...] | None = None
    noise: float = 0.0
    dropout: float = 0.0

    def __post_init__(self) -> None:
        require(self.rays > 0, f"a lidar needs at least one ray, found rays={self.rays}")
        require(self.range > 0, f"a lidar needs a range above 0 m, found range={self.range}")
        require(self.noise >= 0, f"a lidar's noise is a deviation from 0 m upwards, found noise={self.noise}")
        require(0 <= self.dropout <= 1, f"a lidar's dropout is a probability, found dropout={self.dropout}")

    @property
    def shape(self) -> tuple[int, ...]:
        """(rays,)."""
        return (self.rays,)

    def observe(self, batch: WorldBatch, state: State, agents: Int32, rng: np.random.Generator, out: Array) -> Array:  # noqa: ARG002
        """See the class."""
        boxes = state.position, state.heading, state.size, state.object_type, state.present
        cast_at_boxes(agents, *boxes, table(self.types), directions(self.rays), self.range, out)
        add_noise(out, self.noise / self.range, self.dropout, rng)
        return out
