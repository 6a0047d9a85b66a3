"""Which lanes of a map follow one another, as nuPlan's metrics ask for them.

Source: nuplan-devkit, ``planning/metrics/utils/route_extractor.py`` (definitions).
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from functools import cached_property
from itertools import pairwise

import numpy as np

from scenarionet_data.arrays.dtypes import Bool, Float32, Float64, Int32
from scenarionet_data.compiled.decorators import device_function, kernel
from scenarionet_data.scenario.vocabulary import MapFeatureType
from scenarionet_sim.roads.roads import Roads

_ROUNDING = 1e-6  # [m]

LaneRows = tuple[int, ...]
"""Rows of lanes in ``Roads``."""


@dataclass(frozen=True, eq=False)
class LaneLinks:
    """Which lanes of a map follow one another; answers are remembered, as moments ask for the same lanes.

    Attributes:
        roads: The map.
    """

    roads: Roads
    _after: dict[int, LaneRows] = field(default_factory=dict, init=False, repr=False)
    _before: dict[int, LaneRows] = field(default_factory=dict, init=False, repr=False)

    def after(self, lane: int) -> LaneRows:
        """Lanes that follow a lane."""
        if lane not in self._after:
            self._after[lane] = tuple(self.roads.successors[lane].tolist())
        return self._after[lane]

    def before(self, lane: int) -> LaneRows:
        """Lanes that a lane follows."""
        if lane not in self._before:
            places = np.flatnonzero(self.roads.successors.values == lane)
            self._before[lane] = tuple((np.searchsorted(self.roads.successors.offsets, places, "right") - 1).tolist())
        return self._before[lane]

    def line(self, lane: int) -> tuple[Float64, Float64]:
        """Points (P, 2) of a lane, and the arc length (P,) of each [m]."""
        rows = slice(*self.roads.lanes.offsets[lane : lane + 2])
        return self.roads.lanes.values[rows].astype(np.float64), self.roads.once(arcs_of_points)[rows]

    @cached_property
    def is_connector(self) -> Bool:
        """(M,) lanes through an intersection, as nuPlan's maps tell them from others."""
        kind: Bool = self.roads.lane_type == MapFeatureType.LANE_SURFACE_UNSTRUCTURE
        return kind

    def at(self, here: frozenset[int]) -> LaneRows:
        """The lanes around a point, or else the connectors."""
        lanes = tuple(sorted(lane for lane in here if not self.is_connector[lane]))
        return lanes or tuple(sorted(here))

    def continued(self, lanes: LaneRows, here: frozenset[int]) -> LaneRows:
        """Those of some lanes around a point, or of the followers of the only one."""
        found = tuple(lane for lane in lanes if lane in here)
        if not found and len(lanes) == 1:
            found = tuple(lane for lane in self.after(lanes[0]) if lane in here)
        return found

    def by_heading(self, lanes: LaneRows, point: Float64, heading: float) -> LaneRows:
        """The same lanes, the one along a heading first."""
        if len(lanes) < 2:
            return lanes
        line, pose = self.roads.lanes, (*point.tolist(), math.cos(heading), math.sin(heading))
        turned = [-_cosine_along(line.values, line.offsets, lane, *pose) for lane in lanes]
        if all(first <= second for first, second in pairwise(turned)):
            return lanes
        return tuple(lane for _, lane in sorted(zip(turned, lanes, strict=True), key=lambda pair: pair[0]))


@kernel(allocates=False)
def _cosine_along(line: Float32, offsets: Int32, lane: int, x: float, y: float, cos: float, sin: float) -> float:
    """Return the cosine of the angle between a direction and a line at its point nearest to (x, y), or -1.

    Args:
        line, offsets, lane: (P, 2) points of the lines [m], the first row of each, and which line.
        x, y: The point [m].
        cos, sin: The direction.
    """
    cosine, best = -1.0, np.inf
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


def arcs_of_points(roads: Roads) -> Float64:
    """Return the arc length (P,) of every point of the lanes along its lane [m]."""
    arcs = np.zeros(len(roads.lanes.values))
    _sum_hops(roads.lanes.values, roads.lanes.offsets, arcs)
    return arcs


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


@kernel(allocates=False)
def locate_on_line(position: Float64, points: Float64, along: Float64, arcs: Float64, apart: Float64) -> None:
    """Write arc length and distance (T,) of the point of a line nearest to each position; see :func:`nearest_arc`."""
    last = 0
    for t in range(len(position)):
        arcs[t], apart[t], last = nearest_arc(position[t, 0], position[t, 1], points, along, 0, len(points), last)
