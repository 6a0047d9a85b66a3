"""Wrong way, off route and progression: Waymax's metrics about the paths that the ego may take (definitions).

The owner's paths come with its training files and not with the recordings, so they are made from the lanes here: every
way along the lanes from where the recording begins. On the route are those that reach the lane on which it ends, and
the recorded path itself.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from scenarionet_data.arrays.dtypes import Bool, Float64, Int32
from scenarionet_data.compiled.decorators import kernel
from scenarionet_sim.metrics.drive import EgoDrive
from scenarionet_sim.metrics.lane_links import LaneLinks, LaneRows
from scenarionet_sim.metrics.lanes import driven_route
from scenarionet_sim.metrics.waymax.nearest import PointSet
from scenarionet_sim.roads.roads import Roads

WRONG_WAY = 3.5
"""Distance from all paths from which a vehicle drives the wrong way [m]."""

OFF_ROUTE, FARTHER_THAN_OTHERS = 5.0, 2.0
"""Distance from the route, and how much nearer another path may be [m]."""

_SPACING = 1.0  # [m] of points along a path
_BEYOND = 50.0  # [m] that paths go on after the length of the recording
_MOST_PATHS = 32


@dataclass(frozen=True, eq=False)
class Routes:
    """Paths that a vehicle may take, as P points.

    Attributes:
        position: (P, 2) [m].
        arc: (P,) distance along the path [m].
        path: (P,) which path each point belongs to.
        is_on_route: (P,) whether that path is on the route.
    """

    position: Float64
    arc: Float64
    path: Int32
    is_on_route: Bool

    @classmethod
    def of(cls, recorded: EgoDrive, roads: Roads) -> Routes:
        """Paths from the start of a recorded drive."""
        graph, ways = roads.once(LaneLinks), roads.once(_SampledWays)
        driven = [lanes[0] for lanes in driven_route(graph, recorded) if lanes]
        arc = _arcs(recorded.position)
        sampled, is_on_route = [_sampled(recorded.position, arc)], [True]
        for way in ways.of(graph, driven[0], float(arc[-1]) + _BEYOND) if driven else ():
            sampled.append(ways.points(way))
            is_on_route.append(driven[-1] in way)
        count = [len(line) for line in sampled]
        return cls(
            np.concatenate(sampled),
            np.concatenate([np.arange(n) * _SPACING for n in count]),
            np.repeat(np.arange(len(count), dtype=np.int32), count),
            np.repeat(np.array(is_on_route), count),
        )


@dataclass(frozen=True, eq=False)
class RouteDistances:
    """Distances of a vehicle over T moments.

    Attributes:
        on, off: (T,) to the route, and to the other paths [m]; infinite without any.
    """

    on: Float64
    off: Float64

    @classmethod
    def of(cls, position: Float64, routes: Routes) -> RouteDistances:
        """Measure the distances of positions (T, 2) [m] from paths."""
        points = routes.position[routes.is_on_route], routes.position[~routes.is_on_route]
        missing = np.full(len(position), np.inf)
        return cls(*(PointSet.of(each).nearest(position)[1] if len(each) else missing for each in points))


def wrong_way(distances: RouteDistances) -> Float64:
    """Return the distance (T,) from all paths, 0 where it is below 3.5 m [m]."""
    nearest = np.minimum(distances.on, distances.off)
    return np.where(nearest < WRONG_WAY, 0.0, nearest)


def off_route(distances: RouteDistances) -> Float64:
    """Return the distance (T,) from the route, 0 while on it [m].

    It is off the route if that is farther than 5 m, or another path is nearer by more than 2 m.
    """
    on, off = distances.on, distances.off
    return np.where((on > OFF_ROUTE) | (on - off > FARTHER_THAN_OTHERS), on, 0.0)


def progression(position: Float64, start: Float64, end: Float64, routes: Routes) -> float:
    """Return the share of the recorded way along the nearest path on the route; 1 if the recording stands.

    Args:
        position: (2,) where the vehicle is now [m].
        start, end: (2,) first and last recorded positions [m].
        routes: The paths.
    """
    arcs = np.empty(3)
    _find_arcs(np.stack([position, start, end]), routes.position, routes.arc, routes.path, routes.is_on_route, arcs)
    here, first, last = arcs.tolist()
    return 1.0 if first == last else (here - first) / (last - first)


@kernel(allocates=False)
def _find_arcs(places: Float64, points: Float64, arc: Float64, path: Int32, is_on_route: Bool, found: Float64) -> None:
    """Write the arc length (Q,) of places on the path on the route that is nearest to the first of them."""
    chosen = -1
    for q in range(len(places)):
        nearest = np.inf
        for p in range(len(points)):
            apart = np.hypot(points[p, 0] - places[q, 0], points[p, 1] - places[q, 1])
            if apart < nearest and (is_on_route[p] if q == 0 else path[p] == chosen):
                nearest, found[q] = apart, arc[p]
                chosen = path[p] if q == 0 else chosen


class _SampledWays:
    """Ways along the lanes of a map; their points are remembered.

    Args:
        roads: The map.
    """

    def __init__(self, roads: Roads) -> None:
        self._lanes = roads.lanes
        self._length: dict[int, float] = {}
        self._points: dict[LaneRows, Float64] = {}

    def of(self, graph: LaneLinks, first: int, length: float) -> Iterator[LaneRows]:
        """Yield the ways from a lane, up to a length [m]."""
        found, unfinished = 0, list[tuple[LaneRows, float]]([((first,), self._length_of(first))])
        while unfinished and found < _MOST_PATHS:
            way, driven = unfinished.pop(0)
            following = [lane for lane in graph.after(way[-1]) if lane not in way]
            if driven >= length or not following:
                found += 1
                yield way
            else:
                unfinished += [((*way, lane), driven + self._length_of(lane)) for lane in following]

    def points(self, way: LaneRows) -> Float64:
        """Return the points (P, 2) along a way, every metre."""
        if way not in self._points:
            line = np.concatenate([self._lanes[lane] for lane in way]).astype(np.float64)
            self._points[way] = _sampled(line, _arcs(line))
        return self._points[way]

    def _length_of(self, lane: int) -> float:
        if lane not in self._length:
            self._length[lane] = float(_arcs(self._lanes[lane].astype(np.float64))[-1])
        return self._length[lane]


def _arcs(line: Float64) -> Float64:
    """Return the arc length (P,) of the points of a line [m]; 0 for a line without points."""
    steps = np.diff(line, axis=0)
    return np.append(0.0, np.cumsum(np.hypot(steps[:, 0], steps[:, 1])))


def _sampled(line: Float64, arc: Float64) -> Float64:
    """Return points (S, 2) of a line, every metre."""
    wanted = np.arange(0.0, arc[-1] + _SPACING, _SPACING)
    return np.column_stack([np.interp(wanted, arc, line[:, axis]) for axis in range(2)])
