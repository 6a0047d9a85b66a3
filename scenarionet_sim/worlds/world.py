"""One recorded scenario as the arrays a simulation runs on: the log, every object's path, the roads, the lights.

A world is immutable and holds nothing of an episode; that is :class:`~scenarionet_sim.worlds.state.State`. Frame and
units are the scenario's (:mod:`scenarionet_data.scenario.description`).
N objects, T timesteps, P path points, L lights.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from scenarionet_data.arrays.dtypes import Bool, Float32, Float64, Int32, Object, UInt8
from scenarionet_data.arrays.geometry import median_sizes
from scenarionet_data.scenario.description import ScenarioDescription, Tracks
from scenarionet_data.scenario.stop_points import light_places
from scenarionet_sim.kernels.log import HEADING, VALID, VX, YAW_RATE, Z, pack_log
from scenarionet_sim.roads.roads import Roads
from scenarionet_sim.worlds.paths import Paths, Stops


@dataclass(frozen=True, eq=False)
class World:
    """A scenario to simulate.

    Attributes:
        scenario_id: As in the lake.
        dt: Seconds from one timestep to the next.
        ego: Row of the ego.
        track_ids: (N,) str.
        object_type: (N,) uint8 codes of ``ObjectType``.
        size: (N, 3) float32 [m] length, width, height: the median over the valid steps.
        log: (T, N, 8) float32 x, y, z [m], heading [rad], vx, vy [m/s], yaw rate [rad/s], 1 where valid; see
            :mod:`scenarionet_sim.kernels.log` for the columns. ``log_position`` and so on are views of it.
        top_speed: (N,) float32 [m/s] the highest recorded.
        paths: Reference paths.
        stops: Where paths meet lights.
        light_lane: (L,) int32 row of the lane in ``roads``, or -1 when the map lacks it.
        light_stop: (L, 2) float32 [m]; the start of the lane where the source does not say, else NaN.
        light_state: (L, T) uint8 codes of ``LightState``.
        roads: The map.
        extents: (4,) float32 min_x, min_y, max_x, max_y [m] of everything recorded.
    """

    scenario_id: str
    dt: float
    ego: int
    track_ids: Object
    object_type: UInt8
    size: Float32
    log: Float32
    top_speed: Float32
    paths: Paths
    stops: Stops
    light_lane: Int32
    light_stop: Float32
    light_state: UInt8
    roads: Roads
    extents: Float32

    @property
    def num_steps(self) -> int:
        """T."""
        return len(self.log)

    @property
    def num_objects(self) -> int:
        """N."""
        return len(self.track_ids)

    @property
    def log_position(self) -> Float32:
        """(T, N, 2) float32 [m]."""
        return self.log[..., :2]

    @property
    def log_z(self) -> Float32:
        """(T, N) float32 [m] of the box's centre."""
        return self.log[..., Z]

    @property
    def log_heading(self) -> Float32:
        """(T, N) float32 [rad]."""
        return self.log[..., HEADING]

    @property
    def log_velocity(self) -> Float32:
        """(T, N, 2) float32 [m/s]."""
        return self.log[..., VX : VX + 2]

    @property
    def log_yaw_rate(self) -> Float32:
        """(T, N) float32 [rad/s]."""
        return self.log[..., YAW_RATE]

    @cached_property
    def log_valid(self) -> Bool:
        """(T, N) bool."""
        valid: Bool = self.log[..., VALID] != 0
        return valid

    @classmethod
    def from_scenario(cls, scenario: ScenarioDescription) -> World:
        """The world of a scenario."""
        tracks = scenario.tracks
        log = _log(tracks, scenario.timestamps)
        roads, paths = Roads.from_map(scenario.map), Paths.from_log(log)
        lane, stop = light_places(scenario.lights, roads.lane_ids, roads.lanes)
        return cls(
            scenario_id=scenario.id,
            dt=scenario.dt,
            ego=scenario.ego_index,
            track_ids=tracks.ids,
            object_type=tracks.object_type,
            size=median_sizes(tracks.size, tracks.valid),
            log=log,
            top_speed=np.hypot(log[..., VX], log[..., VX + 1]).max(axis=0),
            paths=paths,
            stops=Stops.on(paths, lane, stop, roads),
            light_lane=lane,
            light_stop=stop,
            light_state=scenario.lights.state,
            roads=roads,
            extents=_extents(log),
        )


def _log(tracks: Tracks, timestamps: Float64) -> Float32:
    log = np.zeros((len(timestamps), len(tracks), 8), np.float32)
    pack_log(tracks.position, tracks.heading, tracks.velocity, tracks.valid, timestamps, log)
    return log


def _extents(log: Float32) -> Float32:
    where = log[log[..., VALID] != 0][:, :2]
    return np.concatenate([where.min(axis=0), where.max(axis=0)])
