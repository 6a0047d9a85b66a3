"""Rays at the lines of the map: detectors of the road boundary and of lane lines."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from scenarionet_data.arrays.dtypes import Array, Int32
from scenarionet_data.scenario.vocabulary import MapFeatureType, is_road_edge, is_road_line
from scenarionet_sim.roads.ray_kernels import cast_at_segments
from scenarionet_sim.sensors.base import CompiledSensor, Sensor, add_noise, directions, map_types, require, table
from scenarionet_sim.sensors.observation_kernels import LINE_RAYS
from scenarionet_sim.worlds.state import State
from scenarionet_sim.worlds.world_batch import WorldBatch

BOUNDARIES = (
    MapFeatureType.ROAD_LINE_SOLID_SINGLE_WHITE,
    MapFeatureType.ROAD_LINE_SOLID_DOUBLE_WHITE,
    MapFeatureType.ROAD_LINE_SOLID_SINGLE_YELLOW,
    MapFeatureType.ROAD_LINE_SOLID_DOUBLE_YELLOW,
    *map_types(is_road_edge),
)
"""Lines that a vehicle must not cross: edges and solid lines, as in MetaDrive's side detector. Solid lines are included
because some sources (nuScenes and nuPlan in ScenarioNet's pickles) record the road edge as a solid white line."""


@dataclass(frozen=True)
class LineRays(Sensor):
    """Rays from the agent's centre to the nearest line of the map.

    Observes (rays,) float32 in [0, 1]: the distance as a share of ``range``, 1 without a line in reach or without
    a map. Ray k points 2 pi k / rays counter-clockwise from straight ahead and turns with the agent.
    Objects do not occlude lines.

    Attributes:
        rays: Number of rays.
        range: Largest distance from the agent's centre [m].
        types: Visible line types.
        noise: Standard deviation of the Gaussian range error [m].
        dropout: Probability that a ray has no return.
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
        require(len(self.types) > 0, f"{name} needs at least one line type, found types=()")
        require(self.noise >= 0, f"the noise of {name} must be at least 0 m, found noise={self.noise}")
        require(0 <= self.dropout <= 1, f"the dropout of {name} must be a probability, found dropout={self.dropout}")

    @property
    def shape(self) -> tuple[int, ...]:
        """(rays,)."""
        return (self.rays,)

    @property
    def compiled(self) -> CompiledSensor | None:
        """A part of the compiled step, unless it is noisy."""
        if self.noise or self.dropout:
            return None
        return CompiledSensor(LINE_RAYS, [self.range], self.rays, table(self.types), directions(self.rays))

    def observe(self, batch: WorldBatch, state: State, agents: Int32, rng: np.random.Generator, out: Array) -> Array:
        """Write the ranges."""
        cast_at_segments(agents, state.motion, batch.lines, table(self.types), directions(self.rays), self.range, out)
        add_noise(out, self.noise / self.range, self.dropout, rng)
        return out


@dataclass(frozen=True)
class BoundaryDetector(LineRays):
    """Rays at road edges and solid lines; the paper uses 12 over 50 m. See :class:`LineRays`."""

    types: tuple[MapFeatureType, ...] = BOUNDARIES


@dataclass(frozen=True)
class LaneLineDetector(LineRays):
    """Rays at painted lines, broken and solid, over 20 m. See :class:`LineRays`."""

    range: float = 20.0
    types: tuple[MapFeatureType, ...] = map_types(is_road_line)
