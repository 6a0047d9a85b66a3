"""A bird's-eye-view image with one channel per class, as used by learned planners and policies."""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum
from typing import ClassVar

import numpy as np

from scenarionet_data.arrays.dtypes import Array, Float64, Int16, Int32
from scenarionet_data.compiled.checking import unchecked
from scenarionet_data.errors import BadParameter
from scenarionet_data.scenario.settings import Natural, Positive
from scenarionet_data.scenario.vocabulary import (
    AREAS_TO_DRIVE_ON,
    LIGHT_COLORS,
    LightColor,
    MapFeatureType,
    ObjectType,
    is_lane,
    is_road_edge,
    is_road_line,
)
from scenarionet_sim.arrays.log import HEADING, X, Y
from scenarionet_sim.sensors.base import Sensor, map_types, require
from scenarionet_sim.sensors.raster_kernels import Crossings, draw_boxes, draw_polygons, draw_segments
from scenarionet_sim.worlds.state import History, State
from scenarionet_sim.worlds.world_batch import WorldBatch


class Channel(IntEnum):
    """Channels of a bird's-eye view."""

    ROAD = 0
    CROSSWALK = 1
    ROUTE = 2
    LANE_LINE = 3
    ROAD_EDGE = 4
    LIGHT = 5
    EGO = 6
    VEHICLE = 7
    PEDESTRIAN = 8
    CYCLIST = 9
    OBJECT = 10


LIGHT_VALUES = {LightColor.UNKNOWN: 64, LightColor.GREEN: 128, LightColor.YELLOW: 192, LightColor.RED: 255}
"""Pixel values in the channel LIGHT by colour."""

_LIGHT_SIDE = 2.0  # [m]


def _style(chosen: dict[Channel, tuple[IntEnum, ...]], other: int = -1) -> Int16:
    """Return (256, 2) channel and pixel value by type code; value 255."""
    style = np.full((256, 2), (other, 255), np.int16)
    for channel, types in chosen.items():
        style[[*types], 0] = channel
    return style


_LANES = map_types(is_lane)
_AREAS = _style({Channel.ROAD: (*_LANES, *AREAS_TO_DRIVE_ON), Channel.CROSSWALK: (MapFeatureType.CROSSWALK,)})
_LINES = _style({Channel.LANE_LINE: map_types(is_road_line), Channel.ROAD_EDGE: map_types(is_road_edge)})
_OBJECTS = _style(
    {
        Channel.VEHICLE: (ObjectType.VEHICLE,),
        Channel.PEDESTRIAN: (ObjectType.PEDESTRIAN,),
        Channel.CYCLIST: (ObjectType.CYCLIST,),
    },
    other=Channel.OBJECT,
)
_ROUTE = _style({}, Channel.ROUTE)
_EGO = _style({}, Channel.EGO)
_LIGHTS = _style({}, Channel.LIGHT)
_LIGHTS[: len(LIGHT_COLORS), 1] = [LIGHT_VALUES[LightColor(color)] for color in LIGHT_COLORS]


@dataclass(frozen=True)
class BirdView(Sensor):
    """A bird's-eye-view image around the agent.

    Observes (11 + history, size, size) uint8, row 0 at the top: 255 where an object of the channel's class is,
    else 0; the light channel has ``LIGHT_VALUES``. Channels are those of :class:`Channel`; the agent is only in EGO.
    They are followed by one channel per past moment, the latest first, with the boxes of all objects at that moment
    in the agent's current frame. Areas and boxes cover the pixels whose centres they contain; lines are one pixel wide.

    Attributes:
        size: Side length [pixels].
        resolution: Side length of a pixel [m].
        heading_up: The agent's heading points up; else the scenario's +y does (north, where the source says so).
        anchor: Column and row of the agent, as fractions of ``size``.
        history: History moments shown; the simulation has to remember as many.
    """

    high: ClassVar[float] = 255
    dtype: ClassVar[type[np.generic]] = np.uint8

    size: int = 512
    resolution: Positive = 0.2
    heading_up: bool = True
    anchor: tuple[float, float] = (0.5, 0.5)
    history: Natural = 0

    def __post_init__(self) -> None:
        super().__post_init__()
        require(1 <= self.size <= 8192, f"size={self.size}; a bird's view has 1 to 8192 pixels along a side")

    @property
    def shape(self) -> tuple[int, ...]:
        """(channels, size, size)."""
        return len(Channel) + self.history, self.size, self.size

    def observe(self, batch: WorldBatch, state: State, agents: Int32, rng: np.random.Generator, out: Array) -> Array:  # noqa: ARG002
        """Draw the images.

        Raises:
            BadParameter: The simulation keeps fewer past moments than ``history``.
        """
        remembered = 0 if state.history is None else len(state.history.present)
        if remembered < self.history:
            raise BadParameter(
                f"BirdView(history={self.history}) needs as many past moments, found {remembered}; "
                f"pass history={self.history} to Simulation"
            )
        crossings = Crossings.none(self.size, self.size)
        out[...] = 0
        for (slot, row), pictures in zip(agents.tolist(), out, strict=True):  # an image takes 0.3 to 1 ms
            world, view = batch.worlds[slot], self.view(state.position[slot, row], float(state.heading[slot, row]))
            roads, (first, end) = world.roads, world.paths.path_offsets[row : row + 2]
            outlines = roads.polygons.values, roads.polygons.offsets, roads.polygon_type, roads.polygon_bounds
            draw_polygons(*outlines, _AREAS, view, pictures, crossings)
            draw_segments(roads.segments, roads.segment_type, _LINES, view, pictures)
            points = world.paths.path_points[first:end]
            route = np.concatenate([points[:-1], points[1:]], axis=1)
            draw_segments(route, np.zeros(len(route), np.uint8), _ROUTE, view, pictures)
            stop, shown = world.light_stop, world.light_state[:, min(int(state.timestep[slot]), world.num_steps - 1)]
            motion, size = np.zeros((len(stop), 4)), np.full((len(stop), 3), _LIGHT_SIDE)
            motion[:, X : Y + 1] = stop[:, :2]
            boxes = motion, size, np.ascontiguousarray(shown), ~np.isnan(stop[:, 0])
            unchecked(draw_boxes)(*boxes, _LIGHTS, view, pictures, crossings)
            size, types, others = state.size[slot], state.object_type[slot], state.present[slot].copy()
            others[row] = False
            me, motion, drawn = [row], state.motion[slot], (view, pictures, crossings)
            unchecked(draw_boxes)(motion, size, types, others, _OBJECTS, *drawn)
            unchecked(draw_boxes)(motion[me], size[me], types[me], state.present[slot, me], _EGO, *drawn)
            past = state.history or History.empty(0, *state.present.shape)
            for moment in range(self.history):
                motion = np.zeros_like(motion)
                motion[:, X : Y + 1], motion[:, HEADING] = past.position[moment, slot], past.heading[moment, slot]
                channel = _style({}, len(Channel) + moment)
                unchecked(draw_boxes)(motion, size, types, past.present[moment, slot], channel, *drawn)
        return out

    def view(self, center: Float64, heading: float) -> Float64:
        """Return the map from metres to pixels (6,): column = v0 x + v1 y + v2, row = v3 x + v4 y + v5."""
        cos, sin = (np.cos(heading), np.sin(heading)) if self.heading_up else (0.0, 1.0)
        turn = np.array([[sin, -cos], [-cos, -sin]]) / self.resolution
        start = np.array(self.anchor) * self.size - turn @ center
        return np.array([*turn[0], start[0], *turn[1], start[1]])
