"""A spinning lidar: rings of ranges in space."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from scenarionet_data.arrays.dtypes import Array, Float64, Int32
from scenarionet_data.scenario.vocabulary import ObjectType
from scenarionet_sim.kernels.point_cloud import spin
from scenarionet_sim.sensors.base import Sensor, directions, require, table
from scenarionet_sim.sensors.noise import add_noise
from scenarionet_sim.worlds.state import State
from scenarionet_sim.worlds.world_batch import WorldBatch


@dataclass(frozen=True)
class PointCloud(Sensor):
    """One turn of a lidar with several rings, over the ground and the boxes of other objects.

    Observes (rings, azimuths) float32 in [0, 1]: the range along the ray as a share of ``range``, 1 where nothing is
    in reach; :meth:`points` turns them into points. Ring r has an elevation between ``lowest`` and ``highest``, evenly
    from below; azimuth k is 2 pi k / azimuths counter-clockwise from straight ahead. Boxes stand upright between
    their heights; the ground is the level plane that the agent stands on.

    Attributes:
        rings, azimuths: Numbers of rays.
        range: [m] along the ray.
        lowest, highest: Elevations of the first and last ring [rad].
        mount: Height of the lidar over the ground [m], above the agent's centre.
        types: What is seen; ``ObjectType.GROUND`` is the ground; None: everything.
        noise: Standard deviation of a Gaussian error of the range [m].
        dropout: Probability that a ray sees nothing.
    """

    rings: int = 64
    azimuths: int = 2048
    range: float = 75.0
    lowest: float = -0.31
    highest: float = 0.04
    mount: float = 2.0
    types: tuple[ObjectType, ...] | None = None
    noise: float = 0.0
    dropout: float = 0.0

    def __post_init__(self) -> None:
        require(min(self.rings, self.azimuths) > 0, "a point cloud needs at least one ring and one azimuth")
        require(self.range > 0, f"a point cloud needs a range above 0 m, found range={self.range}")
        level = -np.pi / 2 < self.lowest <= self.highest < np.pi / 2
        require(level, "a point cloud needs -pi/2 < lowest <= highest < pi/2 [rad]")
        require(self.mount > 0, f"a point cloud is measured from above the ground, found mount={self.mount}")
        require(self.noise >= 0, f"a point cloud's noise is a deviation from 0 m upwards, found noise={self.noise}")
        require(0 <= self.dropout <= 1, f"a point cloud's dropout is a probability, found dropout={self.dropout}")

    @property
    def shape(self) -> tuple[int, ...]:
        """(rings, azimuths)."""
        return self.rings, self.azimuths

    @cached_property
    def elevations(self) -> Float64:
        """(rings,) [rad]."""
        return np.linspace(self.lowest, self.highest, self.rings)

    def observe(self, batch: WorldBatch, state: State, agents: Int32, rng: np.random.Generator, out: Array) -> Array:  # noqa: ARG002
        """See the class."""
        boxes = state.position, state.z, state.heading, state.size, state.object_type, state.present
        rays = directions(self.azimuths), np.tan(self.elevations)
        spin(agents, *boxes, table(self.types), *rays, self.mount, self.range, out)
        add_noise(out, self.noise / self.range, self.dropout, rng)
        return out

    def points(self, observed: Array) -> Float64:
        """Points (n, 3) [m] of what one agent observed, x forward, y left, z up from the lidar; without the misses."""
        ranges = self.range * observed[..., None].astype(np.float64)
        flat = directions(self.azimuths)[None] * np.cos(self.elevations)[:, None, None]
        up = np.broadcast_to(np.sin(self.elevations)[:, None, None], (*self.shape, 1))
        points: Float64 = ranges * np.concatenate([flat, up], axis=-1)
        return points[observed < 1.0]
