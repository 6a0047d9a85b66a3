"""A spinning lidar with several rings."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from scenarionet_data.arrays.dtypes import Array, Float64, Int32
from scenarionet_data.scenario.settings import Count, NonNegative, Positive, Share
from scenarionet_data.scenario.vocabulary import ObjectType
from scenarionet_sim.sensors.base import Sensor, add_noise, directions, require, visible_objects
from scenarionet_sim.sensors.point_cloud_kernels import spin
from scenarionet_sim.worlds.state import State
from scenarionet_sim.worlds.world_batch import WorldBatch


@dataclass(frozen=True)
class PointCloud(Sensor):
    """One revolution of a lidar with several rings, over the ground and the boxes of other objects.

    Observes (rings, azimuths) float32 in [0, 1]: the range along the ray as a share of ``range``, 1 without a hit;
    :meth:`points` converts them to points. Ring r has an elevation between ``lowest`` and ``highest``, evenly
    spaced from below; azimuth k is 2 pi k / azimuths counter-clockwise from straight ahead. Boxes are upright;
    the ground is the horizontal plane below the agent.

    Attributes:
        rings, azimuths: Numbers of rays.
        range: Range along the ray [m].
        lowest, highest: Elevations of the first and last ring [rad].
        mount: Height of the lidar over the ground [m], above the agent's centre.
        types: Visible object types; ``ObjectType.GROUND`` is the ground; None for all.
        noise: Standard deviation of the Gaussian range error [m].
        dropout: Probability that a ray has no return.
    """

    rings: Count = 64
    azimuths: Count = 2048
    range: Positive = 75.0
    lowest: float = -0.31
    highest: float = 0.04
    mount: Positive = 2.0
    types: tuple[ObjectType, ...] | None = None
    noise: NonNegative = 0.0
    dropout: Share = 0.0

    def __post_init__(self) -> None:
        super().__post_init__()
        level = -np.pi / 2 < self.lowest <= self.highest < np.pi / 2
        require(level, "a point cloud needs -pi/2 < lowest <= highest < pi/2 [rad]")

    @property
    def shape(self) -> tuple[int, ...]:
        """(rings, azimuths)."""
        return self.rings, self.azimuths

    @cached_property
    def elevations(self) -> Float64:
        """(rings,) [rad]."""
        return np.linspace(self.lowest, self.highest, self.rings)

    def observe(self, batch: WorldBatch, state: State, agents: Int32, rng: np.random.Generator, out: Array) -> Array:  # noqa: ARG002
        """Write the ranges."""
        slopes = np.tan(self.elevations)
        ground = np.ones(self.rings)  # range on the ground as a share of the lidar's
        if self.types is None or ObjectType.GROUND in self.types:
            down = slopes < 0.0
            ground[down] = np.minimum(-self.mount / slopes[down] * np.sqrt(1.0 + slopes[down] ** 2) / self.range, 1.0)
        is_visible, rings = visible_objects(state, self.types), np.column_stack([slopes, ground])
        rays = directions(self.azimuths), rings, (self.mount, self.range)
        spin(agents, state.motion, state.size, is_visible, *rays, out)
        add_noise(out, self.noise / self.range, self.dropout, rng)
        return out

    def points(self, observed: Array) -> Float64:
        """Return the hits of one agent as points (n, 3) [m], x forward, y left, z up from the lidar."""
        ranges = self.range * observed[..., None].astype(np.float64)
        flat = directions(self.azimuths)[None] * np.cos(self.elevations)[:, None, None]
        up = np.broadcast_to(np.sin(self.elevations)[:, None, None], (*self.shape, 1))
        points: Float64 = ranges * np.concatenate([flat, up], axis=-1)
        return points[observed < 1.0]
