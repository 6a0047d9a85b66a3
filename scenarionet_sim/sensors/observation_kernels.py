"""Observations of agents by the sensors that are part of the compiled step."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from scenarionet_data.arrays.dtypes import Bool, Float32, Float64, Int32, UInt8
from scenarionet_data.compiled.decorators import device_function, kernel
from scenarionet_sim.arrays.boxes import Boxes, write_boxes
from scenarionet_sim.arrays.minmax import larger
from scenarionet_sim.arrays.structures import NUM_OBJECTS, OBJECTS, Lines, Recorded, StateArrays
from scenarionet_sim.roads.ray_kernels import RayFan, ranges_to_lines
from scenarionet_sim.sensors.box_ray_kernels import RayMemory, ranges_to_boxes
from scenarionet_sim.sensors.nearest_kernels import OF_OBJECT, OF_PIECE, NearMemory, nearest_objects, nearest_pieces
from scenarionet_sim.sensors.route_kernels import own_motion, way_ahead
from scenarionet_sim.worlds.path_kernels import PathRows

LIDAR, LINE_RAYS, OWN_MOTION, WAY_AHEAD, OBJECTS_NEAR, PIECES_NEAR = range(6)
"""Kinds of sensors."""


class SensorForm(NamedTuple):
    """A sensor as kernels take it, see ``Sensing``.

    Attributes:
        kind: See ``LIDAR``.
        scale: Up to eight numbers.
        parts: Number of rays, points, objects or pieces.
        types: (256,) visible types.
        directions: (R, 2) of the rays.
    """

    kind: int
    scale: Sequence[float]
    parts: int = 0
    types: Bool | None = None
    directions: Float64 | None = None


class Sensing(NamedTuple):
    """Compiled sensors of the agents.

    Attributes:
        kind: (S,) see ``LIDAR``.
        place: (S, 4) first value of the sensor's part of ``out``; values from one agent to the next; first row in
            ``directions``; number of rays, points, objects or pieces.
        scale: (S, 8) range or spacing [m], then what values are divided by (points) or multiplied by (own motion,
            objects).
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
    def of(cls, forms: Sequence[SensorForm]) -> Sensing:
        """Return the arrays of sensors, without places in an array of observations."""
        kind, place = np.zeros(len(forms), np.uint8), np.zeros((len(forms), 4), np.int32)
        scale, types = np.zeros((len(forms), 8)), np.zeros((len(forms), 256), np.bool_)
        directions: list[Float64] = [np.zeros((0, 2))]
        for row, form in enumerate(forms):
            kind[row], scale[row, : len(form.scale)] = form.kind, form.scale
            place[row, 2], place[row, 3] = sum(map(len, directions)), form.parts
            if form.types is not None:
                types[row] = form.types
            if form.directions is not None:
                directions.append(form.directions)
        return cls(kind, place, scale, types, np.concatenate(directions), np.zeros(0, np.float32))


class Scratch(NamedTuple):
    """Memory for the observations of one agent after another.

    Attributes:
        values: (7,) own motion.
        points: (K, 2) points of the path.
        boxes: Boxes of its world.
        rays: Of a lidar.
        near: Objects or pieces in reach.
    """

    values: Float64
    points: Float64
    boxes: Boxes
    rays: RayMemory
    near: NearMemory

    @classmethod
    def of(cls, num_objects: int, num_pieces: int, sensing: Sensing) -> Scratch:
        """Allocate the memory for worlds of up to so many objects and pieces."""
        most = max(sensing.place[:, 3], default=0)
        near = NearMemory.of(max(num_objects, num_pieces) + 1)
        return cls(np.empty(7), np.empty((most, 2)), Boxes.of(num_objects), RayMemory.of(most, num_objects), near)


@device_function(forceinline=True)
def observe(
    a: int, w: int, n: int, recorded: Recorded, lines: Lines, now: StateArrays, sensing: Sensing, scratch: Scratch
) -> None:
    """Write the observations of agent ``a`` by all compiled sensors; ``scratch.boxes`` are those of its world."""
    me, route, row = now.motion[w, n], now.route[w, n], recorded.place[w, OBJECTS] + n
    path = PathRows(recorded.path, recorded.path_offsets[row], recorded.path_offsets[row + 1])
    for s in range(len(sensing.kind)):
        kind, scale, count = sensing.kind[s], sensing.scale[s], sensing.place[s, 3]
        at, ray = sensing.place[s, 0] + a * sensing.place[s, 1], sensing.place[s, 2]
        rays = RayFan(sensing.directions[ray : ray + count], scale[0], sensing.types[s])
        if kind == LIDAR:
            ranges_to_boxes(w, n, now, scratch.boxes, rays, scratch.rays, sensing.out[at : at + count])
        elif kind == LINE_RAYS:
            ranges_to_lines(w, me, lines, rays, sensing.out[at : at + count])
        elif kind == OWN_MOTION:
            own_motion(me, route, now.size[w, n, 0], path, scale[7], scratch.values)
            for k in range(7):
                sensing.out[at + k] = _within(np.float32(scratch.values[k] * scale[k]))
        elif kind == WAY_AHEAD:
            points = scratch.points[:count]
            way_ahead(me, route, path, scale[0], points)
            for k in range(count):
                sensing.out[at + 2 * k] = _within(np.float32(points[k, 0] / scale[1]))
                sensing.out[at + 2 * k + 1] = _within(np.float32(points[k, 1] / scale[1]))
        elif kind == OBJECTS_NEAR:
            out = sensing.out[at : at + OF_OBJECT * count]
            nearest_objects(w, n, now, scratch.boxes, sensing.types[s], scale, scratch.near, out)
        elif kind == PIECES_NEAR:
            nearest_pieces(w, me, lines, scale[0], scratch.near, sensing.out[at : at + OF_PIECE * count])


@device_function
def _within(value: np.float32) -> np.float32:
    """Limit a value to [-1, 1]."""
    return np.float32(-1.0) if value < -1.0 else (np.float32(1.0) if value > 1.0 else value)


@kernel
def observe_by_one(agents: Int32, recorded: Recorded, lines: Lines, now: StateArrays, sensing: Sensing) -> int:
    """Write the observations of agents by one sensor outside of the compiled step.

    Args:
        agents: (A, 2) world and row, sorted.
        recorded, lines: Worlds.
        now: Current state.
        sensing: The sensor.

    Returns:
        Index of the first agent whose arc length is NaN (not located on its path), or -1.
    """
    lost, last, most, count = -1, -1, now.motion.shape[1], sensing.place[0, 3]
    boxes = Boxes(np.empty((7, most)), np.empty(most, np.int32), np.zeros(1, np.int64))
    near, sides, found = np.empty((6, most)), np.empty((4, most)), np.empty((2, most), np.int32)
    room = larger(most, len(lines.pieces)) + 1
    memory = NearMemory(np.empty(room, np.float32), np.empty(room, np.int32), np.empty(room, np.int32))
    scratch = Scratch(np.empty(7), np.empty((count, 2)), boxes, RayMemory(np.empty(count), near, sides, found), memory)
    for a in range(len(agents)):
        w, n = agents[a, 0], agents[a, 1]
        if lost < 0 and np.isnan(now.route[w, n, 0]):
            lost = a
        if w != last and (sensing.kind[0] == LIDAR or sensing.kind[0] == OBJECTS_NEAR):
            write_boxes(recorded.place[w, NUM_OBJECTS], now.motion[w], now.size[w], now.present[w], boxes)
        last = w
        observe(a, w, n, recorded, lines, now, sensing, scratch)
    return lost
