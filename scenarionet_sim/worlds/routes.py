"""Ways along the lanes of a map: how a path goes on where its recording ends."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from scenarionet_data.geometry import wrap_angle
from scenarionet_data.scenario import Bool, Float32, Float64
from scenarionet_sim.kernels.lanes import find_lanes
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
    ends = paths.path_offsets[1:][rows] - 1
    found = np.tile([-1.0, 0.0, _BESIDE], (len(ends), 1))
    lanes = world.roads.lanes
    find_lanes(paths.path_points[ends], paths.path_heading[ends], lanes.values, lanes.offsets, found)
    tails = {
        int(row): _tail(world.roads, int(lane), paths.path_points[end], float(along), beyond)
        for row, end, (lane, along, _) in zip(np.flatnonzero(rows), ends, found, strict=True)
        if lane >= 0
    }
    longer = _lengthened(paths, tails)
    return replace(world, paths=longer, stops=Stops.on(longer, world.light_lane, world.light_stop, world.roads))


def _tail(roads: Roads, lane: int, end: Float32, along: float, beyond: float) -> Float64:
    """(K, 2) points every ``_STEP`` from ``along`` a lane on, from beside it back to its middle."""
    lines = [roads.lanes[lane].astype(np.float64)]
    length = _arc(lines[0])[-1] - along
    while length < beyond and len(roads.successors[lane]):
        lane = _straightest(roads, lane)
        lines.append(roads.lanes[lane].astype(np.float64))
        length += _arc(lines[-1])[-1]
    line = np.concatenate(lines)
    arc, ahead = _arc(line) - along, np.arange(0.0, min(length, beyond) + 1e-6, _STEP)
    points = np.column_stack([np.interp(ahead, arc, line[:, axis]) for axis in range(2)])
    points += (end - points[0]) * np.maximum(1.0 - ahead / _BACK_TO_THE_MIDDLE, 0.0)[:, None]
    return points[1:]


def _straightest(roads: Roads, lane: int) -> int:
    """The successor of a lane that turns least."""
    following = roads.successors[lane]
    turns = [abs(_turn(roads.lanes[successor])) for successor in following]
    return int(following[int(np.argmin(turns))])


def _turn(line: Float32) -> float:
    """Change of direction from a line's start to its end [rad]."""
    if len(line) < 3:
        return 0.0
    first, last = line[1] - line[0], line[-1] - line[-2]
    return float(wrap_angle(np.arctan2(last[1], last[0]) - np.arctan2(first[1], first[0])))


def _arc(line: Float64) -> Float64:
    return np.append(0.0, np.cumsum(np.hypot(*np.diff(line, axis=0).T)))


def _lengthened(paths: Paths, tails: dict[int, Float64]) -> Paths:
    """The paths with tails."""
    parts: list[tuple[Any, ...]] = []
    for row, (first, end) in enumerate(zip(paths.path_offsets[:-1], paths.path_offsets[1:], strict=True)):
        here = slice(first, end)
        own = paths.path_points[here], paths.path_arc[here], paths.path_heading[here], paths.path_z[here]
        parts.append(_appended(own, tails[row]) if row in tails else own)
    points, arc, heading, z = (np.concatenate(column).astype(np.float32) for column in zip(*parts, strict=True))
    offsets = np.append(0, np.cumsum([len(part[1]) for part in parts])).astype(np.int32)
    return Paths(points, arc, heading, z, offsets)


def _appended(own: tuple[Float32, ...], tail: Float64) -> tuple[Float64, ...]:
    points, arc, heading, z = own
    line = np.concatenate([points[-1:], tail])
    steps = np.diff(line, axis=0)
    return (
        np.concatenate([points, tail]),
        np.concatenate([arc, arc[-1] + _arc(line)[1:]]),
        np.concatenate([heading, np.arctan2(steps[:, 1], steps[:, 0])]),
        np.concatenate([z, np.full(len(tail), z[-1])]),
    )
