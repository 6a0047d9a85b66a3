"""Routes along the lanes of the map to a goal, instead of recorded paths."""

from __future__ import annotations

import heapq
from collections.abc import Callable
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
import numpy.typing as npt

from scenarionet_data.arrays.dtypes import Bool, Float64, is_number
from scenarionet_data.errors import BadParameter
from scenarionet_sim.arrays.log import HEADING, Z
from scenarionet_sim.roads.roads import Roads
from scenarionet_sim.worlds.paths import Paths, Stops
from scenarionet_sim.worlds.world import World

Goal = Callable[[World, int], npt.ArrayLike]
"""Maps a world and the row of an object to the point (2,) where it is to go [m]."""

_SPACING = 1.0  # [m] between points of a route
_REACH = 6.0  # [m] from a lane's centreline, a start or a goal is on it
_CHANGE = 25.0  # [m] along the road that a lane change takes
_CHANGE_COST = 50.0  # [m] that a detour may be longer than a lane change
_BESIDE = 1.5  # [m] from the point a lane's width beside a centreline, another lane's is next to it
_LANE_WIDTH = 3.5  # [m]
_BACK_TO_THE_MIDDLE = 20.0  # [m] over which a route that begins beside a centreline reaches it


@dataclass(frozen=True)
class LaneRoute:
    """The shortest way along lanes and their successors, with lane changes where it needs them.

    Attributes:
        goal: Where to go: a point (x, y) in the scenario's frame [m], or a function of a world and an object's row;
            None for the end of the recorded path.
    """

    goal: tuple[float, float] | Goal | None = None

    def __post_init__(self) -> None:
        if self.goal is None or callable(self.goal):
            return
        if np.shape(self.goal) != (2,) or not all(map(is_number, self.goal)):
            raise BadParameter(f"goal={self.goal!r}; expected a point (x, y) [m], a function, or None")

    def applied(self, world: World, rows: Bool) -> World:
        """Return the world in which some objects have the route as their path.

        Args:
            world: As recorded.
            rows: (N,) the objects; those that are never seen or never move keep their paths.

        Raises:
            BadParameter: The start or the goal is off the lanes, or no lanes lead there.
        """
        old = world.paths
        pieces = np.split(old.path, old.path_offsets[1:-1])
        changed = np.flatnonzero(rows & (np.diff(old.path_offsets) > 1)).tolist()
        for row in changed:
            path = pieces[row]
            if self.goal is None:
                goal: npt.ArrayLike = path[-1, :2]
            else:
                goal = self.goal(world, row) if callable(self.goal) else self.goal
            points = route_between(world.roads, path[0, :2], float(path[0, HEADING]), np.asarray(goal, np.float64))
            if points is None:
                raise BadParameter(
                    f"{world.scenario_id}: no lanes lead from the start of {world.track_ids[row]} to "
                    f"{np.round(np.asarray(goal, np.float64), 1).tolist()}; choose a goal on a lane that can be reached"
                )
            nearest = np.argmin(np.hypot(*(points[:, None] - path[None, :, :2]).T), axis=0)
            step = np.diff(points, axis=0)
            heading = np.arctan2(step[:, 1], step[:, 0])
            columns = points, path[nearest, Z], np.append(heading, heading[-1:]), _arcs(points)
            pieces[row] = np.column_stack(columns).astype(np.float32)
        if not changed:
            return world
        offsets = np.append(0, np.cumsum([len(piece) for piece in pieces])).astype(np.int32)
        paths = Paths(np.concatenate(pieces), offsets)
        return replace(world, paths=paths, stops=Stops.on(paths, world.light_lane, world.light_stop, world.roads))


def route_between(roads: Roads, start: npt.ArrayLike, heading: float, goal: npt.ArrayLike) -> Float64 | None:
    """Return points (P, 2) from a pose to a goal along the lanes [m]; None if no lanes lead there.

    Args:
        roads: The map.
        start: (2,) [m].
        heading: [rad].
        goal: (2,) [m].
    """
    here, there = np.asarray(start, np.float64), np.asarray(goal, np.float64)
    first = _lane_at(roads, here, heading, _REACH)
    if first < 0:
        return None
    lines = [np.asarray(roads.lanes[lane], np.float64) for lane in range(roads.num_lanes)]
    ends = [lane for lane, line in enumerate(lines) if len(line) > 1 and _distance(line, there) <= _REACH]
    for lane in sorted(ends, key=lambda lane: _distance(lines[lane], there)):
        way = _shortest(roads, lines, first, lane, here, there)
        points = None if way is None else _drawn(lines, way, roads, here, there)
        if points is not None:
            return points
    return None


def _shortest(
    roads: Roads, lines: list[Float64], first: int, last: int, here: Float64, there: Float64
) -> list[int] | None:
    """Lanes from the first to the last by Dijkstra's algorithm; those that only change lanes follow each other."""
    if first == last and _along(lines[last], there) >= _along(lines[first], here):
        return [first]
    cost, before = {first: 0.0}, {first: -1}
    waiting, seen = [(0.0, first)], set()
    while waiting:
        so_far, lane = heapq.heappop(waiting)
        if lane in seen:
            continue
        seen.add(lane)
        if lane == last and lane != first:
            way = [lane]
            while before[way[-1]] >= 0:
                way.append(before[way[-1]])
            return way[::-1]
        length = float(_arcs(lines[lane])[-1])
        for other, price in [
            *((int(other), length) for other in roads.successors[lane]),
            *((other, _CHANGE_COST) for other in _beside(roads, lines[lane])),
        ]:
            if len(lines[other]) > 1 and so_far + price < cost.get(other, np.inf):
                cost[other], before[other] = so_far + price, lane
                heapq.heappush(waiting, (so_far + price, other))
    return None


def _beside(roads: Roads, line: Float64) -> list[int]:
    """Lanes to the left and to the right of the middle of a lane, in its direction."""
    step = line[len(line) // 2] - line[len(line) // 2 - 1]
    middle, heading = line[len(line) // 2], float(np.arctan2(step[1], step[0]))
    left = _LANE_WIDTH * np.array([-np.sin(heading), np.cos(heading)])
    found = [_lane_at(roads, middle + side * left, heading, _BESIDE) for side in (1.0, -1.0)]
    return [lane for lane in found if lane >= 0]


def _lane_at(roads: Roads, point: Float64, heading: float, reach: float) -> int:
    return int(roads.lanes_along(point[None], [heading], reach)[0, 0])


def _drawn(lines: list[Float64], way: list[int], roads: Roads, here: Float64, there: Float64) -> Float64 | None:
    """Points (P, 2) along lanes, every ``_SPACING``: from the start, which need not be in the middle, to the goal.

    None if the goal is behind the place where its lane is entered.
    """
    pieces = [_cut(lines[way[0]], _along(lines[way[0]], here), np.inf)]
    for lane, following in pairwise(way):
        if following in roads.successors[lane]:
            pieces.append(lines[following])
            continue
        entered = _along(lines[following], pieces[-1][0])
        after = _cut(lines[following], entered + _CHANGE, np.inf)
        pieces[-1] = _change(pieces[-1][0], after)
        pieces.append(after)
    end = _along(pieces[-1], there) if len(pieces[-1]) > 1 else 0.0
    if end <= 0.0:
        return None
    pieces[-1] = _cut(pieces[-1], 0.0, end)
    line = np.concatenate(pieces)
    line = line[np.append(True, np.hypot(*np.diff(line, axis=0).T) > 1e-6)]
    arcs = _arcs(line)
    places = np.append(np.arange(0.0, arcs[-1] - 0.5 * _SPACING, _SPACING), arcs[-1])
    points = np.column_stack([np.interp(places, arcs, line[:, axis]) for axis in range(2)])
    ahead = _SPACING * np.arange(len(points))
    share = np.maximum(1.0 - ahead / _BACK_TO_THE_MIDDLE, 0.0)
    return np.asarray(points + (here - points[0]) * share[:, None])


def _change(start: Float64, lane: Float64) -> Float64:
    """Points (K, 2) of a lane change from a point to the beginning of a lane, without a bend at either end."""
    step = lane[-1] - lane[0] if len(lane) < 2 else lane[1] - lane[0]
    ahead = step / max(float(np.hypot(*step)), 1e-9)
    over = lane[0] - start
    along = float(over @ ahead) * ahead
    share = np.linspace(0.0, 1.0, 26)[:-1, None]
    return np.asarray(start + share * along + share**2 * (3.0 - 2.0 * share) * (over - along))


def _arcs(line: Float64) -> Float64:
    """Arc length (n,) of each point of a line [m]."""
    return np.asarray(np.append(0.0, np.cumsum(np.hypot(*np.diff(line, axis=0).T))))


def _project(line: Float64, point: Float64) -> tuple[float, float]:
    """Arc length of the nearest point of a line, and the distance from it [m]."""
    step = np.diff(line, axis=0)
    square = np.maximum((step * step).sum(axis=1), 1e-12)
    share = np.clip(((point - line[:-1]) * step).sum(axis=1) / square, 0.0, 1.0)
    apart = np.hypot(*(line[:-1] + share[:, None] * step - point).T)
    k = int(np.argmin(apart))
    return float(_arcs(line)[k] + share[k] * np.sqrt(square[k])), float(apart[k])


def _along(line: Float64, point: Float64) -> float:
    return _project(line, point)[0]


def _distance(line: Float64, point: Float64) -> float:
    return _project(line, point)[1]


def _cut(line: Float64, first: float, end: float) -> Float64:
    """The part of a line between two arc lengths; its last point if it ends before the first."""
    arcs = _arcs(line)
    first, end = min(first, float(arcs[-1])), min(end, float(arcs[-1]))
    kept = np.concatenate([[first], arcs[(arcs > first) & (arcs < end)], [end] if end > first else []])
    return np.column_stack([np.interp(kept, arcs, line[:, axis]) for axis in range(2)])
