"""Continuation of recorded paths along the lanes of the map."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from scenarionet_data.arrays.dtypes import Bool, Float64, Int32, IntP
from scenarionet_data.arrays.geometry import wrap_angle
from scenarionet_sim.arrays.log import HEADING, Z
from scenarionet_sim.arrays.structures import Lanes
from scenarionet_sim.roads.lane_kernels import follow_lanes
from scenarionet_sim.roads.roads import Roads
from scenarionet_sim.worlds.paths import Paths, Stops
from scenarionet_sim.worlds.world import World

_BESIDE = 2.5  # [m] from its centreline, an object is on a lane
_STEP = 2.0  # [m] between points
_BACK_TO_THE_MIDDLE = 20.0  # [m] over which a path next to a centreline returns to it


def continued(world: World, rows: Bool, beyond: float) -> World:
    """Return the world with paths that continue along the lanes.

    Args:
        world: As recorded.
        rows: (N,) objects whose paths continue, if they end on a lane in their direction.
        beyond: Length of the continuation [m].
    """
    paths = world.paths
    owners = np.flatnonzero(rows & (np.diff(paths.path_offsets) > 0))
    way, count = ways_beyond(world.roads, paths, owners, beyond)
    if not count.any():
        return world
    own = np.diff(paths.path_offsets)
    added = np.zeros_like(own)
    added[owners] = count  # of the points of each owner's way, those before the lanes end
    offsets = np.append(0, np.cumsum(own + added)).astype(np.int32)
    place = np.arange(len(paths.path)) + np.repeat(offsets[:-1] - paths.path_offsets[:-1], own)
    is_tail = np.ones(offsets[-1], np.bool_)
    is_tail[place] = False
    end = np.repeat(paths.path_offsets[1:] - 1, added)  # last recorded point before each added point
    tail = way[np.arange(way.shape[1]) < count[:, None]]
    step = np.diff(tail, axis=0, prepend=0.0)
    is_first = np.diff(np.repeat(np.arange(len(own)), added), prepend=-1) > 0
    step[is_first] = tail[is_first] - paths.path_points[end[is_first]]
    hops = np.cumsum(np.hypot(step[:, 0], step[:, 1]))
    until = (hops - np.hypot(step[:, 0], step[:, 1]))[is_first]
    arc = hops - np.repeat(until, count[count > 0]) + paths.path_arc[end]
    points = np.empty((len(is_tail), 5), np.float32)
    points[place] = paths.path
    points[is_tail] = np.column_stack([tail, paths.path[end, Z], np.arctan2(step[:, 1], step[:, 0]), arc])
    longer = Paths(points, offsets)
    return replace(world, paths=longer, stops=Stops.on(longer, world.light_lane, world.light_stop, world.roads))


def ways_beyond(roads: Roads, paths: Paths, owners: IntP, beyond: float) -> tuple[Float64, Int32]:
    """Return points every 2 m along the lanes beyond the ends of some paths (Q, K, 2) [m], and their number (Q,).

    A way that begins next to the centreline returns to it.

    Args:
        roads: The map.
        paths: Paths of N objects.
        owners: (Q,) rows of those with a path.
        beyond: Length of the ways [m].
    """
    ends = paths.path_offsets[1:][owners] - 1
    lanes, last = roads.lanes, paths.path_points[ends]
    found = roads.lanes_along(last, paths.path[ends, HEADING], _BESIDE)
    ahead = np.arange(0.0, beyond + 1e-6, _STEP)
    way, count = np.zeros((len(ends), len(ahead), 2)), np.zeros(len(ends), np.int32)
    points, turns, bent = lanes.values.astype(np.float64), np.zeros(roads.num_lanes), np.flatnonzero(lanes.lengths > 2)
    first, end = lanes.offsets[:-1][bent], lanes.offsets[1:][bent]
    start, stop = points[first + 1] - points[first], points[end - 1] - points[end - 2]
    turns[bent] = wrap_angle(np.arctan2(stop[:, 1], stop[:, 0]) - np.arctan2(start[:, 1], start[:, 0]))
    successors = roads.successors
    graph = Lanes(lanes.values, lanes.offsets, successors.values, successors.offsets, turns)
    follow_lanes(found, graph, _STEP, way, count)
    way += (last - way[:, 0])[:, None] * np.maximum(1.0 - ahead / _BACK_TO_THE_MIDDLE, 0.0)[:, None]
    return way[:, 1:], np.maximum(count - 1, 0)  # without the first, the end of the path
