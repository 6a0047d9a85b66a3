"""A spinning lidar in the scene of cameras: meshes, surroundings and heights instead of boxes on a plane."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise

import numpy as np

from scenarionet_data.arrays.dtypes import Array, Float32, Float64, Int32
from scenarionet_data.scenario.settings import Count, NonNegative, Positive, Share
from scenarionet_sim.cameras.classes import SemanticClass
from scenarionet_sim.cameras.draw import codes
from scenarionet_sim.cameras.draw import columns as at
from scenarionet_sim.cameras.drawing import Optics, Rig, draw, poses_on
from scenarionet_sim.cameras.weather import DAY, look_of
from scenarionet_sim.sensors.base import Sensor, add_noise, require
from scenarionet_sim.sensors.camera import Mount
from scenarionet_sim.worlds.state import State
from scenarionet_sim.worlds.world_batch import WorldBatch

REFLECTIVITY = {
    SemanticClass.ROAD: 0.12,
    SemanticClass.LANE_LINE: 0.60,
    SemanticClass.CROSSWALK: 0.45,
    SemanticClass.SIDEWALK: 0.30,
    SemanticClass.VEGETATION: 0.40,
    SemanticClass.TRAFFIC_CONE: 0.80,
    SemanticClass.TRAFFIC_SIGN: 0.90,
}
"""Share of light that surfaces of a class send back when hit at a right angle; 0.35 for others. Rounded, for the
near infrared."""

_OTHERS = 0.35
_ROOF = Mount(x=0.0, z=1.84)


@dataclass(frozen=True)
class SceneLidar(Sensor):
    """One revolution of a lidar whose rays hit meshes, buildings, trees and the ground with its heights.

    Observes (rings, azimuths, 2) float32 in [0, 1]: the range along the ray as a share of ``range``, 1 without a hit,
    and the intensity: the reflectivity of the surface times the cosine of the angle of incidence, 0 without a hit.
    Azimuth k is 2 pi k / azimuths counter-clockwise from straight ahead. :meth:`points` converts them to points.

    Attributes:
        elevations: Of the rings [rad], from the highest to the lowest.
        azimuths: Number of rays of a ring.
        range: Range along the ray [m].
        mount: Place on the agent.
        noise: Standard deviation of the Gaussian range error [m].
        dropout: Probability that a ray has no return.
        has_scenery: Whether there are buildings, trees and lamps off the road, drawn by ``seed``.
        are_boxes: Whether objects are their boxes instead of meshes.
        seed: Seed of the scenery.
        threads: Largest number of threads; the result does not depend on it.
    """

    elevations: tuple[float, ...]
    azimuths: Count = 1800
    range: Positive = 100.0
    mount: Mount = _ROOF
    noise: NonNegative = 0.0
    dropout: Share = 0.0
    has_scenery: bool = True
    are_boxes: bool = False
    seed: int = 0
    threads: Count = 1

    def __post_init__(self) -> None:
        super().__post_init__()
        numbers = np.asarray(self.elevations)
        require(numbers.dtype.kind in "if", f"elevations={self.elevations!r}; expected angles [rad]")
        require(bool(self.elevations), "a lidar needs at least one ring")
        require(max(len(self.elevations), self.azimuths) <= 16384, "a lidar has at most 16384 rings and azimuths")
        is_descending = all(a > b for a, b in pairwise(self.elevations))
        require(is_descending, "a lidar's elevations must descend")
        require(max(map(abs, self.elevations)) < np.pi / 2, "a lidar's elevations must be within (-pi/2, pi/2) [rad]")

    @property
    def shape(self) -> tuple[int, ...]:
        """(rings, azimuths, 2)."""
        return len(self.elevations), self.azimuths, 2

    @cached_property
    def _rays(self) -> Float64:
        """(rings, azimuths, 3) unit vectors right, down and ahead."""
        rise, turn = np.array(self.elevations)[:, None], 2 * np.pi * np.arange(self.azimuths) / self.azimuths
        parts = -np.cos(rise) * np.sin(turn), -np.sin(rise) + 0 * turn, np.cos(rise) * np.cos(turn)
        rays = np.ascontiguousarray(np.stack(parts, axis=-1))
        rays.flags.writeable = False
        return rays

    @cached_property
    def _optics(self) -> Optics:
        lens = np.zeros(at.NUM_LENS)
        lens[at.KIND], lens[[at.FX, at.FY]] = codes.RINGS, self.azimuths / (2 * np.pi)
        size = self.azimuths, len(self.elevations)
        return Optics(lens, *size, self.range, self.are_boxes, 0.0, self._rays, np.tan(self.elevations))

    def observe(self, batch: WorldBatch, state: State, agents: Int32, rng: np.random.Generator, out: Array) -> Array:
        """Write ranges and intensities."""
        mount, count = self.mount, len(agents)
        turns = np.array([(mount.yaw, mount.pitch, mount.roll)] * count).reshape(-1, 3)
        poses = poses_on(batch, state, agents, (mount.x, mount.y, mount.z), turns)
        who = np.column_stack([agents, np.zeros(count, np.int32)])
        look = look_of(("",), np.zeros(count, np.int32), DAY, 0, 1.0, 0.0)
        channels = "depth", "semantic", "normals"
        rig = Rig(who, poses, look, (True, self.has_scenery, self.seed))
        found = draw(batch, state, rig, self._optics, channels, self.threads)
        out[..., 0] = np.minimum(found["depth"] / self.range, 1.0)
        ways = self._rays.astype(np.float32) @ poses[:, None, 3:12].reshape(count, 1, 3, 3).astype(np.float32)
        cosine = np.abs(np.einsum("ahwc,ahwc->ahw", ways, found["normals"]))
        out[..., 1] = _TABLE[found["semantic"]] * np.minimum(cosine, 1.0)
        add_noise(out[..., 0], self.noise / self.range, self.dropout, rng)
        out[..., 1][out[..., 0] >= 1.0] = 0.0
        return out

    def points(self, observed: Array) -> Float32:
        """Return the hits (n, 4) of one observation: x ahead, y left, z up of the lidar [m], and the intensity."""
        right, down, ahead = np.moveaxis(self._rays, -1, 0)
        hit = observed[..., 0] < 1.0
        way = np.stack([ahead, -right, -down], axis=-1)[hit]
        place = way * (observed[..., 0][hit] * self.range)[:, None]
        return np.column_stack([place, observed[..., 1][hit]]).astype(np.float32)


_TABLE: Float32 = np.array([REFLECTIVITY.get(code, _OTHERS) for code in sorted(SemanticClass)], np.float32)
