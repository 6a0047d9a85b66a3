"""One scenario as pictures see it: the map's shapes, who is where when, what the lights show."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from scenarionet_data.arrays.dtypes import Bool, Float32, Object, UInt8
from scenarionet_data.arrays.geometry import median_sizes
from scenarionet_data.plots.moment import Moment
from scenarionet_data.plots.shapes import MapShapes
from scenarionet_data.scenario.description import ScenarioDescription
from scenarionet_data.scenario.stop_points import light_places
from scenarionet_data.scenario.vocabulary import is_lane


@dataclass(frozen=True, eq=False)
class Scene:
    """A scenario to draw: N objects, T timesteps, L lights; metres, radians, scenario frame.

    Attributes:
        scenario_id: As in the lake.
        dt: Seconds from one timestep to the next.
        current_timestep: Last timestep of the history.
        ego: Row of the ego.
        track_ids: (N,) str.
        object_type: (N,) uint8 codes of ``ObjectType``.
        size: (N, 2 or more) float32 [m] length and width.
        position: (T, N, 2) float32 [m].
        heading: (T, N) float32 [rad].
        speed: (T, N) float32 [m/s].
        present: (T, N) bool.
        light_stop: (L, 2) float32 [m]; NaN where nobody knows.
        light_state: (L, T) uint8 codes of ``LightState``.
        map: What it looks like.
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
        """The scene of a scenario; a scene is its own."""
        if isinstance(scenario, Scene):
            return scenario
        tracks, shapes = scenario.tracks, MapShapes.from_map(scenario.map)
        lane_ids = scenario.map.ids[is_lane(scenario.map.types)] if scenario.map else np.zeros(0, object)
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
        """T."""
        return len(self.position)

    @property
    def num_objects(self) -> int:
        """N."""
        return len(self.track_ids)

    @cached_property
    def route(self) -> Float32:
        """(n, 2) [m] where the ego is recorded, in order."""
        route: Float32 = self.position[self.present[:, self.ego], self.ego]
        return route

    def moment(self, timestep: int) -> Moment:
        """As recorded at a timestep."""
        position, heading = self.position[timestep], self.heading[timestep]
        return Moment(timestep, position.astype(np.float64), heading.astype(np.float64), self.present[timestep])

    def moments(self) -> list[Moment]:
        """All that is recorded, in order."""
        return [self.moment(timestep) for timestep in range(self.num_steps)]

    def lights_at(self, timestep: int) -> UInt8:
        """(L,) codes of ``LightState``; past the recording's end what they showed last."""
        states: UInt8 = self.light_state[:, min(timestep, self.num_steps - 1)]
        return states
