"""One recorded scenario as the arrays of a simulation: log, reference paths, roads and lights.

A world is immutable and independent of episodes, see :class:`~scenarionet_sim.worlds.state.State`. Frame and units
are the scenario's (:mod:`scenarionet_data.scenario.description`).
N objects, T timesteps, P path points, L lights.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from scenarionet_data.arrays.dtypes import Bool, Float32, Int32, Object, UInt8
from scenarionet_data.arrays.geometry import median_sizes
from scenarionet_data.building import resample
from scenarionet_data.scenario.description import ScenarioDescription
from scenarionet_data.scenario.stop_points import light_places
from scenarionet_sim.arrays.log import HEADING, VALID, VX, Z, write_log
from scenarionet_sim.roads.heights import Heights
from scenarionet_sim.roads.roads import Roads
from scenarionet_sim.worlds.paths import Paths, Stops

STEP = 0.1
"""Timestep of a simulation [s], that of the metrics of nuPlan, Waymo and ScenarioNet."""


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
        log: (T, N, 8) float32 x, y, z [m], heading [rad], vx, vy [m/s], yaw rate [rad/s], 1 where valid, else 0;
            columns as in ``arrays.log``. ``log_position`` and so on are views of it.
        top_speed: (N,) float32 highest recorded speed [m/s].
        paths: Reference paths.
        stops: Stop points of lights on the paths.
        light_lane: (L,) int32 row of the lane in ``roads``, or -1 if the map lacks it.
        light_stop: (L, 2) float32 [m]; the start of the lane if the source has none, NaN if that is unknown too.
        light_state: (L, T) uint8 codes of ``LightState``.
        roads: The map.
        extents: (4,) float32 min_x, min_y, max_x, max_y [m] of everything recorded.
        heights: Heights of the ground; None where it is level at z = 0.
        friction: Factor on the grip of vehicles that are driven by actions, from ``extras["friction"]``.
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
    heights: Heights | None = None
    friction: float = 1.0

    def store_log(self, read: Callable[[], Float32]) -> None:
        """Drop the log, which is stored elsewhere, until it is asked for.

        Args:
            read: Returns a copy of it; not called after :meth:`restore_log`.
        """
        vars(self)["_read_log"] = read
        vars(self).pop("log", None)

    def restore_log(self) -> Float32:
        """Read the log, if it is stored elsewhere, and keep it; return it."""
        if "log" not in vars(self):
            vars(self)["log"] = vars(self)["_read_log"]()
        vars(self).pop("_read_log", None)
        log: Float32 = vars(self)["log"]
        return log

    if not TYPE_CHECKING:  # other names are errors

        def __getattr__(self, name: str) -> Float32:
            """Return the log if it is stored elsewhere."""
            if name == "log" and "_read_log" in vars(self):
                return self.restore_log()
            raise AttributeError(f"{type(self).__name__!r} object has no attribute {name!r}")

    def __getstate__(self) -> dict[str, Any]:
        self.restore_log()
        return vars(self)

    @property
    def num_steps(self) -> int:
        """Number of timesteps (T)."""
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
    def log_heading(self) -> Float32:
        """(T, N) float32 [rad]."""
        return self.log[..., HEADING]

    @property
    def log_velocity(self) -> Float32:
        """(T, N, 2) float32 [m/s]."""
        return self.log[..., VX : VX + 2]

    @cached_property
    def log_valid(self) -> Bool:
        """(T, N) bool."""
        valid: Bool = self.log[..., VALID] != 0
        return valid

    def __repr__(self) -> str:
        return f"World({self.scenario_id!r}, {len(self.log)} timesteps of {self.dt} s, {len(self.track_ids)} objects)"

    @classmethod
    def from_scenario(cls, scenario: ScenarioDescription, dt: float = STEP) -> World:
        """Convert a scenario; no array of the world shares its memory, which is that of all its tracks.

        Args:
            scenario: The scenario.
            dt: Timestep of the simulation [s]; recordings at other times are resampled to it.

        Raises:
            BadParameter: These are no scenario and timestep.
        """
        scenario = resample(scenario, dt)
        tracks = scenario.tracks
        log = np.empty((len(scenario.timestamps), len(tracks), 8), np.float32)
        extents = np.empty(4, np.float32)
        write_log(tracks.position, tracks.heading, tracks.velocity, tracks.valid, scenario.timestamps, log, extents)
        roads, paths = Roads.from_map(scenario.map), Paths.from_log(log)
        lane, stop = light_places(scenario.lights, roads.lane_ids, roads.lanes)
        size, heights = median_sizes(tracks.size, tracks.valid), None
        if scenario.has_z:
            bottoms = (log[..., Z] - size[:, 2] / 2)[log[..., VALID] != 0]
            heights = Heights.from_map(scenario.map, float(np.median(bottoms)))
        return cls(
            scenario_id=scenario.id,
            dt=dt,
            ego=scenario.ego_index,
            track_ids=tracks.ids,
            object_type=tracks.object_type.copy(),
            size=size,
            log=log,
            top_speed=np.hypot(log[..., VX], log[..., VX + 1]).max(axis=0),
            paths=paths,
            stops=Stops.on(paths, lane, stop, roads),
            light_lane=lane,
            light_stop=stop,
            light_state=scenario.lights.state.copy(),
            roads=roads,
            extents=extents,
            heights=heights,
            friction=float(scenario.extras.get("friction", 1.0)),
        )
