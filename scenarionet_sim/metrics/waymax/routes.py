"""Wrong way, off route and progression: Waymax's metrics about the paths that the ego may take (definitions).

The owner's paths come with its training files and not with the recordings, so they are made from the lanes here: every
way along the lanes from where the recording begins. On the route are those that reach the lane on which it ends, and
the recorded path itself.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache

import numpy as np

from scenarionet_data.arrays.dtypes import Bool, Float64, Int32
from scenarionet_sim.metrics.drive import EgoDrive
from scenarionet_sim.metrics.lane_links import LaneLinks
from scenarionet_sim.metrics.lanes import driven_route
from scenarionet_sim.metrics.waymax.nearest import nearest_rows
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
        lines, is_on_route, graph = [recorded.position], [True], LaneLinks(roads)
        driven = [lanes[0] for lanes in driven_route(graph, recorded) if lanes]
        if driven:
            length = float(np.hypot(*np.diff(recorded.position, axis=0).T).sum()) + _BEYOND
            for way in _ways(graph, driven[0], length):
                lines.append(np.concatenate([roads.lanes[lane] for lane in way]).astype(np.float64))
                is_on_route.append(driven[-1] in way)
        sampled = []
        for line in lines:  # every metre
            hops = np.hypot(*np.diff(line, axis=0).T) if len(line) > 1 else np.zeros(0)
            arc = np.append(0.0, np.cumsum(hops))
            wanted = np.arange(0.0, arc[-1] + _SPACING, _SPACING)
            sampled.append(np.column_stack([np.interp(wanted, arc, line[:, axis]) for axis in range(2)]))
        count = [len(line) for line in sampled]
        return cls(
            np.concatenate(sampled),
            np.concatenate([np.arange(n) * _SPACING for n in count]),
            np.repeat(np.arange(len(count), dtype=np.int32), count),
            np.repeat(np.array(is_on_route), count),
        )


def wrong_way(position: Float64, routes: Routes) -> Float64:
    """Return the distance (T,) from all paths, 0 where it is below 3.5 m [m].

    Args:
        position: (T, 2) [m].
        routes: The paths.
    """
    nearest = _distance(position, routes.position)
    return np.where(nearest < WRONG_WAY, 0.0, nearest)


def off_route(position: Float64, routes: Routes) -> Float64:
    """Return the distance (T,) from the route, 0 while on it [m].

    It is off the route if that is farther than 5 m, or another path is nearer by more than 2 m.

    Args:
        position: (T, 2) [m].
        routes: The paths.
    """
    on = _distance(position, routes.position[routes.is_on_route])
    off = _distance(position, routes.position[~routes.is_on_route])
    return np.where((on > OFF_ROUTE) | (on - off > FARTHER_THAN_OTHERS), on, 0.0)


def progression(position: Float64, start: Float64, end: Float64, routes: Routes) -> float:
    """Return the share of the recorded way along the nearest path on the route; 1 if the recording stands.

    Args:
        position: (2,) where the vehicle is now [m].
        start, end: (2,) first and last recorded positions [m].
        routes: The paths.
    """
    on = np.flatnonzero(routes.is_on_route)
    nearest = on[np.hypot(*(routes.position[on] - position).T).argmin()]
    path = np.flatnonzero(routes.path == routes.path[nearest])

    def arc(point: Float64) -> float:
        return float(routes.arc[path[np.hypot(*(routes.position[path] - point).T).argmin()]])

    first, last = arc(start), arc(end)
    return 1.0 if first == last else (arc(position) - first) / (last - first)


def _distance(position: Float64, points: Float64) -> Float64:
    """Distance (T,) to the nearest point [m]; infinite without points."""
    if not len(points):
        return np.full(len(position), np.inf)
    away = points[nearest_rows(position, points)] - position
    return np.sqrt(away[:, 0] ** 2 + away[:, 1] ** 2)


def _ways(graph: LaneLinks, first: int, length: float) -> Iterator[list[int]]:
    """Ways along the lanes from one of them, up to a length [m]."""

    @cache
    def length_of(lane: int) -> float:
        return float(np.hypot(*np.diff(graph.roads.lanes[lane], axis=0).T).sum())

    found, unfinished = 0, [([first], length_of(first))]
    while unfinished and found < _MOST_PATHS:
        way, driven = unfinished.pop(0)
        following = [lane for lane in graph.after(way[-1]) if lane not in way]
        if driven >= length or not following:
            found += 1
            yield way
        else:
            unfinished += [([*way, lane], driven + length_of(lane)) for lane in following]
