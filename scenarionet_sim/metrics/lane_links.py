"""Which lanes of a map follow one another, as nuPlan's metrics ask for them.

Source: nuplan-devkit, ``planning/metrics/utils/route_extractor.py`` (definitions).
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from scenarionet_data.arrays.dtypes import Bool, Float32, Float64, Int32
from scenarionet_data.compiled.decorators import device_function, kernel
from scenarionet_data.scenario.vocabulary import MapFeatureType
from scenarionet_sim.arrays.containment import PolygonGrid
from scenarionet_sim.roads.roads import Roads

_ROUNDING = 1e-6  # [m]

LaneRows = tuple[int, ...]
"""Rows of lanes in ``Roads``."""


class LaneLinks(NamedTuple):
    """The M lanes of a map, and which of them follow one another; from ``roads.once(LaneLinks.of)``.

    Attributes:
        points, offsets: Centrelines: lane i is ``points[offsets[i]:offsets[i + 1]]`` (n, 2) [m].
        arcs: (P,) arc length of every point along its lane [m].
        followers, follower_offsets: Lanes that follow each lane.
        leaders, leader_offsets: Lanes that each lane follows.
        is_connector: (M,) lanes through an intersection, as nuPlan's maps tell them from others.
        speed_limit: (M,) [m/s], NaN when unknown.
        polygons: Outlines of the lanes and of all other areas, under a grid.
        is_crossing: (Q,) which of them are intersections.
        most: Largest number of lanes of one moment: those in a cell of the grid, or that follow one.
    """

    points: Float32
    offsets: Int32
    arcs: Float64
    followers: Int32
    follower_offsets: Int32
    leaders: Int32
    leader_offsets: Int32
    is_connector: Bool
    speed_limit: Float32
    polygons: PolygonGrid
    is_crossing: Bool
    most: int

    @classmethod
    def of(cls, roads: Roads) -> LaneLinks:
        """Return the lanes of a map."""
        arcs = np.zeros(len(roads.lanes.values))
        _sum_hops(roads.lanes.values, roads.lanes.offsets, arcs)
        after, (polygons, in_cell) = roads.successors, roads.gridded_polygons
        owner = np.repeat(np.arange(len(after), dtype=np.int32), after.lengths)
        order, lanes = np.argsort(after.values, kind="stable"), np.arange(len(after) + 1)
        return cls(
            points=roads.lanes.values,
            offsets=roads.lanes.offsets,
            arcs=arcs,
            followers=after.values,
            follower_offsets=after.offsets,
            leaders=owner[order],
            leader_offsets=np.searchsorted(after.values[order], lanes).astype(np.int32),
            is_connector=roads.lane_type == MapFeatureType.LANE_SURFACE_UNSTRUCTURE,
            speed_limit=roads.speed_limit,
            polygons=polygons,
            is_crossing=roads.polygon_type == MapFeatureType.INTERSECTION,
            most=max(in_cell, 1) + int(after.lengths.max(initial=0)),
        )

    def after(self, lane: int) -> LaneRows:
        """Lanes that follow a lane."""
        return tuple(self.followers[slice(*self.follower_offsets[lane : lane + 2])].tolist())


@device_function
def cosine_along(line: Float32, offsets: Int32, lane: int, x: float, y: float, heading: float) -> float:
    """Return the cosine of the angle between a direction and a line at its point nearest to (x, y), or -1.

    Args:
        line, offsets, lane: (P, 2) points of the lines [m], the first row of each, and which line.
        x, y: The point [m].
        heading: The direction [rad].
    """
    cosine, best, cos, sin = -1.0, np.inf, math.cos(heading), math.sin(heading)
    for n in range(offsets[lane], offsets[lane + 1] - 1):
        x0, y0 = np.float64(line[n, 0]), np.float64(line[n, 1])
        dx, dy = line[n + 1, 0] - x0, line[n + 1, 1] - y0
        square = max(dx * dx + dy * dy, 1e-12)
        share = min(max(((x - x0) * dx + (y - y0) * dy) / square, 0.0), 1.0)
        apart_x, apart_y = x0 + share * dx - x, y0 + share * dy - y
        apart = apart_x * apart_x + apart_y * apart_y
        if apart < best:
            cosine, best = (dx * cos + dy * sin) / math.sqrt(square), apart
    return cosine


@kernel(allocates=False)
def _sum_hops(points: Float32, offsets: Int32, arcs: Float64) -> None:
    """Write the arc lengths (P,) of the points of lines, zeros before."""
    for lane in range(len(offsets) - 1):
        for n in range(offsets[lane] + 1, offsets[lane + 1]):
            dx, dy = points[n, 0] - np.float64(points[n - 1, 0]), points[n, 1] - np.float64(points[n - 1, 1])
            arcs[n] = arcs[n - 1] + math.sqrt(dx * dx + dy * dy)


@device_function
def nearest_arc(
    x: float, y: float, points: Float32 | Float64, along: Float64, first: int, end: int, guess: int
) -> tuple[float, float, int]:
    """Return arc length [m] of a line's point nearest to (x, y), distance [m], and row of its segment.

    Args:
        x, y: The point [m].
        points, along: (P, 2) points of lines [m], and the arc length of each [m].
        first, end: Rows of the line; with less than two, the arc length is NaN and the distance infinite.
        guess: Row of a segment that may be near.
    """
    guess = guess if first <= guess < end - 1 else first
    arc, nearest, last, n, free = np.nan, np.inf, guess, first - 1, -np.inf
    most = math.hypot(x - points[guess, 0], y - points[guess, 1]) if first < end else 0.0
    while n + 2 < end:
        n += 1
        if along[n + 1] < free:
            n = _last_before(free, along, n + 1, end) - 1
            continue
        x0, y0 = np.float64(points[n, 0]), np.float64(points[n, 1])
        away = math.sqrt((x - x0) * (x - x0) + (y - y0) * (y - y0))
        free = along[n] + away - min(most, nearest) - _ROUNDING  # up to there the line is farther than what is found
        if along[n + 1] < free:
            continue
        dx, dy = points[n + 1, 0] - x0, points[n + 1, 1] - y0
        square = dx * dx + dy * dy
        length, share = math.sqrt(square), 0.0
        if square > 0.0:
            share = min(max(((x - x0) * dx + (y - y0) * dy) / square, 0.0), 1.0)
        if share == 0.0:
            apart = away
        elif share == 1.0:
            x1, y1 = np.float64(points[n + 1, 0]), np.float64(points[n + 1, 1])
            apart = math.sqrt((x - x1) * (x - x1) + (y - y1) * (y - y1))
        else:
            apart = abs(((y0 - y) * dx - (x0 - x) * dy) / square) * length
        if apart < nearest:
            nearest, last, arc = apart, n, along[n] + share * length
    return arc, nearest, last


@device_function
def _last_before(arc: float, along: Float64, first: int, end: int) -> int:
    """Return the last row of a line, from ``first`` on, whose arc length is less; that of ``first`` is."""
    while end - first > 1:
        middle = (first + end) // 2
        if along[middle] < arc:
            first = middle
        else:
            end = middle
    return first
