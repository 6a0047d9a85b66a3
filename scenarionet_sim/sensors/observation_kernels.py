"""Observations of agents by the sensors that are part of the compiled step."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from scenarionet_data.arrays.dtypes import Bool, Float32, Float64, Int32, UInt8
from scenarionet_data.compiled.decorators import device_function
from scenarionet_sim.arrays.boxes import Boxes
from scenarionet_sim.arrays.structures import OBJECTS, Lines, Recorded, StateArrays
from scenarionet_sim.roads.ray_kernels import ranges_to_lines
from scenarionet_sim.sensors.box_ray_kernels import RayMemory, ranges_to_boxes
from scenarionet_sim.sensors.route_kernels import own_motion, way_ahead
from scenarionet_sim.worlds.path_kernels import PathRows

LIDAR, LINE_RAYS, OWN_MOTION, WAY_AHEAD = range(4)
"""Kinds of sensors."""


class Sensing(NamedTuple):
    """Compiled sensors of the agents.

    Attributes:
        kind: (S,) see ``LIDAR``.
        place: (S, 4) first value of the sensor's part of ``out``; values from one agent to the next; first row in
            ``directions``; number of rays or points.
        scale: (S, 8) range or spacing [m], then what values are divided by (points) or multiplied by (own motion).
        types: (S, 256) visible types; all objects for a lidar whose row is all True.
        directions: (R, 2) unit vectors of the rays of all sensors.
        out: Values of all agents, one after another.
    """

    kind: UInt8
    place: Int32
    scale: Float64
    types: Bool
    directions: Float64
    out: Float32

    @classmethod
    def of_no_sensors(cls) -> Sensing:
        """Return the arrays of no sensors."""
        no_place, no_types = np.zeros((0, 4), np.int32), np.zeros((0, 256), np.bool_)
        return cls(
            np.zeros(0, np.uint8), no_place, np.zeros((0, 8)), no_types, np.zeros((0, 2)), np.zeros(0, np.float32)
        )


class Scratch(NamedTuple):
    """Memory for the observations of one agent after another.

    Attributes:
        values: (7,) own motion.
        points: (K, 2) points of the path.
        boxes: Boxes of its world.
        rays: Of a lidar.
    """

    values: Float64
    points: Float64
    boxes: Boxes
    rays: RayMemory

    @classmethod
    def of(cls, num_objects: int, sensing: Sensing) -> Scratch:
        """Allocate the memory."""
        most = max(sensing.place[:, 3], default=0)
        return cls(np.empty(7), np.empty((most, 2)), Boxes.of(num_objects), RayMemory.of(most, num_objects))


@device_function(forceinline=True)
def observe(
    a: int,
    w: int,
    n: int,
    num_boxes: int,
    recorded: Recorded,
    lines: Lines,
    then: StateArrays,
    routes: Float64,
    sensing: Sensing,
    scratch: Scratch,
) -> None:
    """Write the observations of an agent by all compiled sensors; ``num_boxes`` is that of ``scratch.boxes``."""
    me, route, row = then.motion[w, n], routes[w, n], recorded.place[w, OBJECTS] + n
    path = PathRows(recorded.path, recorded.path_offsets[row], recorded.path_offsets[row + 1])
    for s in range(len(sensing.kind)):
        kind, scale, count = sensing.kind[s], sensing.scale[s], sensing.place[s, 3]
        at, ray = sensing.place[s, 0] + a * sensing.place[s, 1], sensing.place[s, 2]
        if kind == LIDAR:
            rays, seen = sensing.directions[ray : ray + count], sensing.out[at : at + count]
            world = scratch.boxes, num_boxes, then.object_type[w], sensing.types[s]
            ranges_to_boxes(n, then.motion[w], *world, rays, scale[0], scratch.rays, seen)
        elif kind == LINE_RAYS:
            rays = sensing.directions[ray : ray + count]
            ranges_to_lines(w, me, lines, sensing.types[s], rays, scale[0], sensing.out[at : at + count])
        elif kind == OWN_MOTION:
            own_motion(me, route, then.size[w, n, 0], path, scale[7], scratch.values)
            for k in range(7):
                sensing.out[at + k] = _within(np.float32(scratch.values[k] * scale[k]))
        elif kind == WAY_AHEAD:
            points = scratch.points[:count]
            way_ahead(me, route, path, scale[0], points)
            for k in range(count):
                sensing.out[at + 2 * k] = _within(np.float32(points[k, 0] / scale[1]))
                sensing.out[at + 2 * k + 1] = _within(np.float32(points[k, 1] / scale[1]))


@device_function
def _within(value: np.float32) -> np.float32:
    """Limit a value to [-1, 1]."""
    return np.float32(-1.0) if value < -1.0 else (np.float32(1.0) if value > 1.0 else value)
