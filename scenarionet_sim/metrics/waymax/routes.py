"""Wrong way, off route and progression: Waymax's metrics about the paths that the ego may take (definitions).

The owner's paths come with its training files and not with the recordings, so they are made from the lanes here: every
way along the lanes from where the recording begins. On the route are those that reach the lane on which it ends, and
the recorded path itself.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from scenarionet_data.arrays.dtypes import Float64, Int32, Int64
from scenarionet_data.compiled.decorators import kernel
from scenarionet_sim.metrics.drive import Drives
from scenarionet_sim.metrics.lane_links import LaneLinks, LaneRows
from scenarionet_sim.metrics.waymax.nearest import BoxedLines, nearest_row, nearest_to
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
    """Paths that B vehicles may take.

    Attributes:
        paths: Points of all paths (P, 2) [m].
        arcs: (P,) distance of each along its path [m].
        on, off: Numbers of the paths on the route of each vehicle, and of the others, with the first of each (B + 1,).
    """

    paths: BoxedLines
    arcs: Float64
    on: tuple[Int64, Int64]
    off: tuple[Int64, Int64]

    @classmethod
    def of(cls, recorded: Drives, lanes: Int32, roads: Roads) -> Routes:
        """Paths from the starts of recorded drives; the first ones are those of the drives themselves.

        Args:
            recorded: The drives.
            lanes: (S, most) their lanes, see ``DrivenLanes``.
            roads: The map.
        """
        links, ways = roads.once(LaneLinks.of), roads.once(_SampledWays)
        arcs = np.zeros(len(lanes))
        hops = np.diff(recorded.centre[:, 0], axis=0)
        _sum_hops(recorded.offsets, np.hypot(hops[:, 0], hops[:, 1]), arcs)
        lengths = [float(arcs[end - 1]) if end else 0.0 for end in recorded.offsets[1:].tolist()]
        counts = [int(np.ceil(length + _SPACING)) for length in lengths]
        own = np.empty((sum(counts), 2))
        _sample(recorded.offsets, recorded.centre, arcs, np.append(0, np.cumsum(counts)), own)
        known, on, off = dict[LaneRows, int](), list[list[int]](), list[list[int]]()
        for number, length in enumerate(lengths):
            on.append([number])
            off.append([])
            driven = lanes[recorded.part(number), 0]
            driven = driven[driven >= 0]
            for way in ways.of(links, int(driven[0]), length + _BEYOND) if len(driven) else ():
                place = known.setdefault(way, len(lengths) + len(known))
                (on if driven[-1] in way else off)[number].append(place)
        counts += [len(ways.points(way)) for way in known]
        paths = BoxedLines.of(np.concatenate([own, *(ways.points(way) for way in known)]), np.array(counts))
        return cls(paths, np.concatenate([np.arange(n) * _SPACING for n in counts]), _listed(on), _listed(off))

    def distances(self, drives: Drives) -> RouteDistances:
        """Measure the distances of drives from their paths."""
        on, off = np.full((2, len(drives.heading)), np.inf)
        for found, (which, first) in ((on, self.on), (off, self.off)):
            _find_distances(drives.offsets, drives.centre[:, 0], self.paths, which, first, found)
        return RouteDistances(on, off)

    def progression(self, drives: Drives, recorded: Drives) -> Float64:
        """Return the shares (B,) of the recorded ways along the path on the route that is nearest to the vehicle.

        Args:
            drives: Vehicles, of which the last places count.
            recorded: The recordings, of which the first and last places count; if they are one, the share is 1.
        """
        ends, known = drives.offsets[1:] - 1, recorded.offsets
        places = drives.centre[ends, 0], recorded.centre[known[:-1], 0], recorded.centre[known[1:] - 1, 0]
        arcs = np.empty((len(ends), 3))
        find_arcs(np.stack(places, axis=1), self.paths, self.arcs, *self.on, arcs)
        here, first, last = arcs.T
        way = last - first
        return np.where(way == 0.0, 1.0, (here - first) / np.where(way == 0.0, 1.0, way))


def _listed(lists: list[list[int]]) -> tuple[Int64, Int64]:
    """Return the numbers of all lists, and the first of each."""
    flat = [number for each in lists for number in each]
    return np.array(flat, np.int64), np.append(0, np.cumsum([len(each) for each in lists]))


@dataclass(frozen=True, eq=False)
class RouteDistances:
    """Distances of vehicles over S moments.

    Attributes:
        on, off: (S,) to the route, and to the other paths [m]; infinite without any.
    """

    on: Float64
    off: Float64


def wrong_way(distances: RouteDistances) -> Float64:
    """Return the distance (S,) from all paths, 0 where it is below 3.5 m [m]."""
    nearest = np.minimum(distances.on, distances.off)
    return np.where(nearest < WRONG_WAY, 0.0, nearest)


def off_route(distances: RouteDistances) -> Float64:
    """Return the distance (S,) from the route, 0 while on it [m].

    It is off the route if that is farther than 5 m, or another path is nearer by more than 2 m.
    """
    on, off = distances.on, distances.off
    return np.where((on > OFF_ROUTE) | (on - off > FARTHER_THAN_OTHERS), on, 0.0)


@kernel(allocates=False)
def _sum_hops(offsets: Int64, hops: Float64, arcs: Float64) -> None:
    """Write the distances (S,) along drives, zeros before, by those from each moment to the next."""
    for b in range(len(offsets) - 1):
        for t in range(offsets[b] + 1, offsets[b + 1]):
            arcs[t] = arcs[t - 1] + hops[t - 1]


@kernel(allocates=False)
def _sample(offsets: Int64, centre: Float64, arcs: Float64, first: Int64, sampled: Float64) -> None:
    """Write points (P, 2) of drives, every metre; ``first`` is the first of each."""
    for b in range(len(offsets) - 1):
        t, last = offsets[b], offsets[b + 1] - 1
        for n in range(first[b + 1] - first[b]):
            wanted = n * _SPACING
            while t < last and arcs[t + 1] <= wanted:
                t += 1
            for axis in range(2):
                value = centre[t, 0, axis]
                if t < last:
                    value += (centre[t + 1, 0, axis] - value) / (arcs[t + 1] - arcs[t]) * (wanted - arcs[t])
                sampled[first[b] + n, axis] = value


@kernel(allocates=False)
def _find_distances(
    offsets: Int64, places: Float64, paths: BoxedLines, which: Int64, first: Int64, found: Float64
) -> None:
    """Write the distances (S,) from the nearest of some paths, infinite before; see ``Routes``."""
    for b in range(len(offsets) - 1):
        for k in range(first[b], first[b + 1]):
            n, last = which[k], 0
            points = paths.points[paths.first[n] : paths.first[n + 1]]
            boxes = paths.boxes[paths.first_box[n] : paths.first_box[n + 1]]
            groups = paths.groups[paths.first_group[n] : paths.first_group[n + 1]]
            for t in range(offsets[b], offsets[b + 1]):
                last, square = nearest_to(places, t, points, boxes, groups, last)
                found[t] = min(found[t], math.sqrt(square))


@kernel(allocates=False)
def find_arcs(places: Float64, paths: BoxedLines, arcs: Float64, which: Int64, first: Int64, found: Float64) -> None:
    """Write the arc lengths (B, 3) of places (B, 3, 2) on the path that is nearest to the first of them."""
    for b in range(len(found)):
        nearest, chosen = np.inf, -1
        for k in range(first[b], first[b + 1]):
            begin, end = paths.first[which[k]], paths.first[which[k] + 1]
            _, square = nearest_row(places[b], 0, paths.points[begin:end])
            if square < nearest:
                nearest, chosen = square, which[k]
        begin, end = paths.first[chosen], paths.first[chosen + 1]
        for q in range(3):
            row, _ = nearest_row(places[b], q, paths.points[begin:end])
            found[b, q] = arcs[begin + row]


class _SampledWays:
    """Ways along the lanes of a map; their points are remembered.

    Args:
        roads: The map.
    """

    def __init__(self, roads: Roads) -> None:
        self._lanes = roads.lanes
        self._length: dict[int, float] = {}
        self._points: dict[LaneRows, Float64] = {}

    def of(self, links: LaneLinks, first: int, length: float) -> Iterator[LaneRows]:
        """Yield the ways from a lane, up to a length [m]."""
        found, unfinished = 0, list[tuple[LaneRows, float]]([((first,), self._length_of(first))])
        while unfinished and found < _MOST_PATHS:
            way, driven = unfinished.pop(0)
            following = [lane for lane in links.after(way[-1]) if lane not in way]
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
