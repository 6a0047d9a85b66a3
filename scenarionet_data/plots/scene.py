"""A scenario prepared for drawing: map shapes, object states, traffic lights, and the visible window."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import numpy.typing as npt

from scenarionet_data.arrays.dtypes import Bool, Float32, Float64, Object, UInt8, is_count, is_number
from scenarionet_data.arrays.geometry import median_sizes
from scenarionet_data.building import resample
from scenarionet_data.errors import BadParameter
from scenarionet_data.plots.shapes import MapShapes
from scenarionet_data.scenario.description import ScenarioDescription
from scenarionet_data.scenario.stop_points import light_places
from scenarionet_data.scenario.vocabulary import is_lane

MARGIN = 30.0
"""Margin around the content [m]."""

_LEAST = 80.0
"""Minimum side of a window around a route [m]."""


@dataclass(frozen=True, eq=False)
class Moment:
    """States of the N objects of a scene at one timestep, recorded or simulated.

    Attributes:
        timestep: Timestep since the start of the recording; after its end, lights keep their last state.
        position: (N, 2) float64 [m].
        heading: (N,) float64 [rad].
        present: (N,) bool.
    """

    timestep: int
    position: Float64
    heading: Float64
    present: Bool


@dataclass(frozen=True, eq=False)
class Scene:
    """A scenario to draw with N objects, T timesteps and L lights, in the scenario frame.

    Attributes:
        scenario_id: Id in the lake.
        dt: Time between timesteps [s].
        current_timestep: Last timestep of the history.
        ego: Row of the ego.
        track_ids: (N,) str.
        object_type: (N,) uint8 codes of ``ObjectType``.
        size: (N, 2 or more) float32 [m] length and width.
        position: (T, N, 2) float32 [m].
        heading: (T, N) float32 [rad].
        speed: (T, N) float32 [m/s].
        present: (T, N) bool.
        light_stop: (L, 2) float32 [m]; NaN where unknown.
        light_state: (L, T) uint8 codes of ``LightState``.
        map: Shapes of the map.
    """

    scenario_id: str
    dt: float
    current_timestep: int
    ego: int
    track_ids: Object
    object_type: UInt8
    size: Float32
    position: Float32
    heading: Float32
    speed: Float32
    present: Bool
    light_stop: Float32
    light_state: UInt8
    map: MapShapes

    @classmethod
    def of(cls, scenario: ScenarioDescription | Scene) -> Scene:
        """Return the scene of a scenario, with timesteps of ``scenario.dt``; a scene is returned unchanged."""
        if isinstance(scenario, Scene):
            return scenario
        scenario = resample(scenario)
        tracks, shapes = scenario.tracks, MapShapes.from_map(scenario.map)
        lane_ids = scenario.map.ids[is_lane(scenario.map.feature_type)] if scenario.map else np.zeros(0, object)
        return cls(
            scenario_id=scenario.id,
            dt=scenario.dt,
            current_timestep=scenario.current_timestep,
            ego=scenario.ego_index,
            track_ids=tracks.ids,
            object_type=tracks.object_type,
            size=median_sizes(tracks.size, tracks.valid),
            position=tracks.position[..., :2].swapaxes(0, 1),
            heading=tracks.heading.T,
            speed=np.hypot(tracks.velocity[..., 0], tracks.velocity[..., 1]).T,
            present=tracks.valid.T,
            light_stop=light_places(scenario.lights, lane_ids, shapes.lanes)[1],
            light_state=scenario.lights.state,
            map=shapes,
        )

    @property
    def num_steps(self) -> int:
        """Number of timesteps T."""
        return len(self.position)

    @property
    def num_objects(self) -> int:
        """Number of objects N."""
        return len(self.track_ids)

    @cached_property
    def route(self) -> Float32:
        """Recorded positions of the ego (n, 2) [m], in order."""
        route: Float32 = self.position[self.present[:, self.ego], self.ego]
        return route

    def moment(self, timestep: int) -> Moment:
        """Return the recorded states at a timestep."""
        position, heading = self.position[timestep], self.heading[timestep]
        return Moment(timestep, position.astype(np.float64), heading.astype(np.float64), self.present[timestep])

    def timestep(self, given: int | None) -> int:
        """Return a timestep, the current one by default.

        Raises:
            BadParameter: There is no such timestep.
        """
        if given is None:
            return self.current_timestep
        if not (is_count(given) and given < self.num_steps):
            raise BadParameter(f"{self.scenario_id}: no timestep {given!r}; there are 0 to {self.num_steps - 1}")
        return given

    def moments(self) -> list[Moment]:
        """Return all recorded states, in order."""
        return [self.moment(timestep) for timestep in range(self.num_steps)]

    def lights_at(self, timestep: int) -> UInt8:
        """Return codes of ``LightState`` (L,); after the end of the recording, the last ones."""
        return self.light_state[:, min(timestep, self.num_steps - 1)]


@dataclass(frozen=True)
class Window:
    """The visible part of the world, an axis-aligned rectangle.

    Attributes:
        x, y: Centre [m].
        width, height: Size [m].
    """

    x: float
    y: float
    width: float
    height: float

    def __post_init__(self) -> None:
        if not all(map(is_number, (self.x, self.y, self.width, self.height))) or not min(self.width, self.height) > 0:
            raise BadParameter(
                f"width and height of a window must be positive, found {self.width!r} x {self.height!r} m"
            )

    @property
    def corners(self) -> tuple[float, float, float, float]:
        """Limits min_x, max_x, min_y, max_y [m]."""
        half_x, half_y = self.width / 2, self.height / 2
        return self.x - half_x, self.x + half_x, self.y - half_y, self.y + half_y

    def shaped(self, ratio: float) -> Window:
        """Return the smallest window around this one with the given aspect ratio (width / height)."""
        return Window(self.x, self.y, max(self.width, ratio * self.height), max(self.height, self.width / ratio))

    @classmethod
    def around(cls, points: npt.ArrayLike) -> Window:
        """Return the window around points (n, 2) [m] with a margin."""
        where = np.asarray(points, np.float64).reshape(-1, 2)
        lower, upper = where.min(axis=0) - MARGIN, where.max(axis=0) + MARGIN
        width, height = np.maximum(upper - lower, _LEAST)
        x, y = (lower + upper) / 2
        return cls(float(x), float(y), float(width), float(height))

    @classmethod
    def on_route(cls, scene: Scene) -> Window:
        """Return the window around the recorded route of the ego."""
        return cls.around(scene.route)

    @classmethod
    def on_everything(cls, scene: Scene) -> Window:
        """Return the window around all recorded objects."""
        return cls.around(scene.position[scene.present])
