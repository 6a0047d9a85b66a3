"""One recorded scenario as the arrays a simulation runs on: the log, every object's path, the roads, the lights.

A world is immutable and holds nothing of an episode; that is :class:`scenarionet_sim.state.State`. Frame and units
are the scenario's (:mod:`scenarionet_data.scenario`). N objects, T timesteps, P path points, L lights.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from scenarionet_data.scenario import Bool, Codes, Float32, Lights, ScenarioDescription, Strings, Tracks
from scenarionet_sim.kernels.log import HEADING, VALID, VX, YAW_RATE, Z, median_sizes, pack_log, thin
from scenarionet_sim.kernels.paths import find_stops
from scenarionet_sim.roads import Roads

Int32 = npt.NDArray[np.int32]

SPACING = 0.1
"""Points of a path are at least this far apart [m]: a standing object's noise makes no path."""


@dataclass(frozen=True, eq=False)
class Paths:
    """Where each object drove, without when: the reference path of each, the ego's is its route.

    Object n has the points ``offsets[n]:offsets[n + 1]``; none when it is never valid, one when it stands.

    Attributes:
        path_points: (P, 2) float32 [m], at least ``SPACING`` apart.
        path_arc: (P,) float32 [m] distance from the path's first point.
        path_heading: (P,) float32 [rad] as recorded: an object may drive backwards.
        path_z: (P,) float32 [m] of the box's centre.
        path_offsets: (N + 1,) int32.
    """

    path_points: Float32
    path_arc: Float32
    path_heading: Float32
    path_z: Float32
    path_offsets: Int32

    def length(self) -> Float32:
        """(N,) float32 [m] length of each path, 0 without points."""
        first, end = self.path_offsets[:-1], self.path_offsets[1:]
        length = np.zeros(len(first), np.float32)
        length[end > first] = self.path_arc[end[end > first] - 1]
        return length


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
        stop_arc, stop_light: (K,) float32 [m], int32: where a path meets the stop point of a light that governs
            it, and which light; object n has ``stop_offsets[n]:stop_offsets[n + 1]``, in order along the path.
        stop_offsets: (N + 1,) int32.
        light_lane: (L,) int32 row of the lane in ``roads``, or -1 when the map lacks it.
        light_stop: (L, 2) float32 [m]; the start of the lane where the source does not say, else NaN.
        light_state: (L, T) uint8 codes of ``LightState``.
        roads: The map.
        extents: (4,) float32 min_x, min_y, max_x, max_y [m] of everything recorded.
    """

    scenario_id: str
    dt: float
    ego: int
    track_ids: Strings
    object_type: Codes
    size: Float32
    log: Float32
    top_speed: Float32
    paths: Paths
    stop_arc: Float32
    stop_light: Int32
    stop_offsets: Int32
    light_lane: Int32
    light_stop: Float32
    light_state: Codes
    roads: Roads
    extents: Float32

    @property
    def num_steps(self) -> int:
        """T."""
        return len(self.log)

    @property
    def num_objects(self) -> int:
        """N."""
        return self.log.shape[1]

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

    @property
    def log_valid(self) -> Bool:
        """(T, N) bool."""
        return self.log[..., VALID] != 0

    @classmethod
    def from_scenario(cls, scenario: ScenarioDescription) -> World:
        """The world of a scenario."""
        tracks = scenario.tracks
        log = _log(tracks, scenario.timestamps)
        size = np.empty((len(tracks), 3), np.float32)
        median_sizes(tracks.size, tracks.valid, size)
        roads, paths = Roads.from_map(scenario.map), _paths(log)
        lane, stop = _light_places(scenario.lights, roads)
        stop_arc, stop_light, stop_offsets = _stops(paths, lane, stop, roads)
        return cls(
            scenario_id=scenario.id,
            dt=scenario.dt,
            ego=scenario.ego_index,
            track_ids=tracks.ids,
            object_type=tracks.object_type,
            size=size,
            log=log,
            top_speed=np.hypot(log[..., VX], log[..., VX + 1]).max(axis=0),
            paths=paths,
            stop_arc=stop_arc,
            stop_light=stop_light,
            stop_offsets=stop_offsets,
            light_lane=lane,
            light_stop=stop,
            light_state=scenario.lights.state,
            roads=roads,
            extents=_extents(log),
        )


def _log(tracks: Tracks, timestamps: npt.NDArray[np.float64]) -> Float32:
    log = np.empty((len(timestamps), len(tracks), 8), np.float32)
    pack_log(tracks.position, tracks.heading, tracks.velocity, tracks.valid, timestamps, log)
    return log


def _paths(log: Float32) -> Paths:
    is_kept = np.empty((log.shape[1], log.shape[0]), np.bool_)
    thin(log, SPACING, is_kept)
    track, step = np.nonzero(is_kept)
    states = log[step, track]
    offsets = np.concatenate([[0], np.cumsum(is_kept.sum(axis=1))]).astype(np.int32)
    hops = np.append(0.0, np.hypot(*np.diff(states[:, :2].astype(np.float64), axis=0).T))
    total = np.cumsum(hops)
    arc = total - np.repeat(total[np.minimum(offsets[:-1], max(len(total) - 1, 0))], np.diff(offsets))
    columns = (states[:, :2], arc, states[:, HEADING], states[:, Z])
    return Paths(*(np.ascontiguousarray(column, np.float32) for column in columns), offsets)


def _light_places(lights: Lights, roads: Roads) -> tuple[Int32, Float32]:
    """(L,) rows of the lights' lanes and (L, 2) where to stop for them."""
    row_of = {lane: row for row, lane in enumerate(roads.lane_ids)}
    lane = np.array([row_of.get(name, -1) for name in lights.lane_ids], np.int32)
    stop = np.ascontiguousarray(lights.stop_point[:, :2])
    assumed = np.isnan(stop).any(axis=1) & (lane >= 0)
    assumed[assumed] = roads.lanes.lengths[lane[assumed]] > 0
    stop[assumed] = roads.lanes.values[roads.lanes.offsets[lane[assumed]]]
    return lane, stop


def _stops(paths: Paths, lane: Int32, stop: Float32, roads: Roads) -> tuple[Float32, Int32, Int32]:
    """Stops of each path: arcs, lights, offsets."""
    num_objects, num_lights = len(paths.path_offsets) - 1, len(lane)
    found = np.full((num_objects, num_lights), np.nan, np.float32)
    arrays = paths.path_points, paths.path_arc, paths.path_heading, paths.path_offsets
    find_stops(*arrays, lane, stop, roads.lanes.values, roads.lanes.offsets, found)
    order = np.argsort(found, axis=1, kind="stable")
    arcs = np.take_along_axis(found, order, axis=1)
    is_stop = ~np.isnan(arcs)
    offsets = np.concatenate([[0], np.cumsum(is_stop.sum(axis=1))]).astype(np.int32)
    return arcs[is_stop], order[is_stop].astype(np.int32), offsets


def _extents(log: Float32) -> Float32:
    where = log[log[..., VALID] != 0][:, :2]
    return np.concatenate([where.min(axis=0), where.max(axis=0)])
