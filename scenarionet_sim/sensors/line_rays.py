"""Rays at the lines of the map, the part that boundary and lane-line detectors share."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from scenarionet_data.arrays.dtypes import Array, Int32
from scenarionet_data.scenario.vocabulary import MapFeatureType
from scenarionet_sim.kernels.rays import cast_at_segments
from scenarionet_sim.sensors.base import Sensor, directions, require, table
from scenarionet_sim.sensors.noise import add_noise
from scenarionet_sim.worlds.state import State
from scenarionet_sim.worlds.world_batch import WorldBatch


@dataclass(frozen=True)
class LineRays(Sensor):
    """Rays from the agent's centre to the nearest line of the map.

    Observes (rays,) float32 in [0, 1]: the distance as a share of ``range``, 1 where no line is in reach or the
    scenario has no map. Ray k points 2 pi k / rays counter-clockwise from straight ahead and turns with the agent.
    Other objects do not stand in the way.

    Attributes:
        rays: Number of rays.
        range: [m] from the agent's centre.
        types: The lines that are seen.
        noise: Standard deviation of a Gaussian error of the distance [m].
        dropout: Probability that a ray sees nothing.
    """

    rays: int = 12
    range: float = 50.0
    types: tuple[MapFeatureType, ...] = ()
    noise: float = 0.0
    dropout: float = 0.0

    def __post_init__(self) -> None:
        name = type(self).__name__
        require(self.rays > 0, f"{name} needs at least one ray, found rays={self.rays}")
        require(self.range > 0, f"{name} needs a range above 0 m, found range={self.range}")
        require(len(self.types) > 0, f"{name} needs at least one type of line to see, found types=()")
        require(self.noise >= 0, f"the noise of {name} is a deviation from 0 m upwards, found noise={self.noise}")
        require(0 <= self.dropout <= 1, f"the dropout of {name} is a probability, found dropout={self.dropout}")

    @property
    def shape(self) -> tuple[int, ...]:
        """(rays,)."""
        return (self.rays,)

    def observe(self, batch: WorldBatch, state: State, agents: Int32, rng: np.random.Generator, out: Array) -> Array:
        """See the class."""
        cast_at_segments(
            agents,
            state.position,
            state.heading,
            batch.segments,
            batch.segment_type,
            table(self.types),
            batch.segment_grid_origin,
            batch.segment_grid_shape,
            batch.segment_grid_cell_size,
            batch.segment_grid_cell_start,
            batch.segment_grid_cell_items,
            directions(self.rays),
            self.range,
            out,
        )
        add_noise(out, self.noise / self.range, self.dropout, rng)
        return out
