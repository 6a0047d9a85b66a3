"""Ways along the lanes of a map: how a path goes on where its recording ends."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from scenarionet_data.arrays.dtypes import Bool, Float64, Int32, IntP
from scenarionet_data.arrays.geometry import wrap_angle
from scenarionet_sim.kernels.lanes import find_lanes, follow_lanes
from scenarionet_sim.roads.roads import Roads
from scenarionet_sim.worlds.paths import Paths, Stops
from scenarionet_sim.worlds.world import World

_BESIDE = 2.5  # [m] from a centreline an object is still on the lane
_STEP = 2.0  # [m] between points
_BACK_TO_THE_MIDDLE = 20.0  # [m] over which a path that ends beside a centreline comes back to it


def continued(world: World, rows: Bool, beyond: float) -> World:
    """The world with paths that go on along the lanes.

    Args:
        world: As recorded.
        rows: (N,) objects whose paths go on, where they end on a lane that leads their way.
        beyond: How far [m].
    """
    paths = world.paths
    owners = np.flatnonzero(rows & (np.diff(paths.path_offsets) > 0))
    way, count = _ways(world.roads, paths, owners, beyond)
    if not count.any():
        return world
    longer = _lengthened(paths, owners, way, count)
    return replace(world, paths=longer, stops=Stops.on(longer, world.light_lane, world.light_stop, world.roads))


def _ways(roads: Roads, paths: Paths, owners: IntP, beyond: float) -> tuple[Float64, Int32]:
    """(Q, K, 2) points every ``_STEP`` behind the ends of these objects' paths, and how many of them there are.

    A way that begins beside its lane comes back to the lane's middle.
    """
    ends = paths.path_offsets[1:][owners] - 1
    found = np.tile([-1.0, 0.0, _BESIDE], (len(ends), 1))
    lanes, last = roads.lanes, paths.path_points[ends]
    find_lanes(last, paths.path_heading[ends], lanes.values, lanes.offsets, found)
    ahead = np.arange(0.0, beyond + 1e-6, _STEP)
    way, count = np.zeros((len(ends), len(ahead), 2)), np.zeros(len(ends), np.int32)
    following = roads.successors
    follow_lanes(
        found, lanes.values, lanes.offsets, following.values, following.offsets, _turns(roads), _STEP, way, count
    )
    way += (last - way[:, 0])[:, None] * np.maximum(1.0 - ahead / _BACK_TO_THE_MIDDLE, 0.0)[:, None]
    return way[:, 1:], np.maximum(count - 1, 0)  # the first is where the path ends


def _turns(roads: Roads) -> Float64:
    """(M,) change of direction from each lane's start to its end [rad]."""
    points, turns = roads.lanes.values.astype(np.float64), np.zeros(roads.num_lanes)
    bent = np.flatnonzero(roads.lanes.lengths > 2)
    first, end = roads.lanes.offsets[:-1][bent], roads.lanes.offsets[1:][bent]
    start, stop = points[first + 1] - points[first], points[end - 1] - points[end - 2]
    turns[bent] = wrap_angle(np.arctan2(stop[:, 1], stop[:, 0]) - np.arctan2(start[:, 1], start[:, 0]))
    return turns


def _lengthened(paths: Paths, owners: IntP, way: Float64, count: Int32) -> Paths:
    """The paths with ``count`` points of each owner's way behind its own."""
    own = np.diff(paths.path_offsets)
    added = np.zeros_like(own)
    added[owners] = count
    offsets = np.append(0, np.cumsum(own + added)).astype(np.int32)
    place = np.arange(len(paths.path_arc)) + np.repeat(offsets[:-1] - paths.path_offsets[:-1], own)
    is_tail = np.ones(offsets[-1], np.bool_)
    is_tail[place] = False
    end = np.repeat(paths.path_offsets[1:] - 1, added)  # of the path in front of each added point
    tail = way[np.arange(way.shape[1]) < count[:, None]]
    step = np.diff(tail, axis=0, prepend=0.0)
    is_first = np.diff(np.repeat(np.arange(len(own)), added), prepend=-1) > 0
    step[is_first] = tail[is_first] - paths.path_points[end[is_first]]
    hops = np.cumsum(np.hypot(step[:, 0], step[:, 1]))
    until = (hops - np.hypot(step[:, 0], step[:, 1]))[is_first]
    arc = hops - np.repeat(until, count[count > 0]) + paths.path_arc[end]
    columns = tail, arc, np.arctan2(step[:, 1], step[:, 0]), paths.path_z[end]
    recorded = paths.path_points, paths.path_arc, paths.path_heading, paths.path_z
    joined = [np.empty((len(is_tail), *values.shape[1:]), np.float32) for values in recorded]
    for values, before, behind in zip(joined, recorded, columns, strict=True):
        values[place], values[is_tail] = before, behind
    points, arcs, headings, z = joined
    return Paths(points, arcs, headings, z, offsets)
