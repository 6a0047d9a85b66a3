"""The lanes that a drive is on, and what nuPlan's metrics derive from them.

Source: nuplan-devkit, ``planning/metrics/utils/route_extractor.py``, ``ego_lane_change.py``,
``driving_direction_compliance.py`` and ``speed_limit_compliance.py`` (definitions). In nuPlan's maps only lane
connectors overlap, in those of other datasets any lanes do: all that contain a point are candidates, and the one
along the heading counts first.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
import shapely

from scenarionet_data.arrays.compiled import kernel
from scenarionet_data.arrays.dtypes import Bool, Float32, Float64, Int32
from scenarionet_data.scenario.vocabulary import MapFeatureType
from scenarionet_sim.metrics.drive import EgoDrive
from scenarionet_sim.roads.roads import Roads

_NEAR_CONNECTOR = 5.0  # [m] from a connector a vehicle is still assigned to it, while in an intersection

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

    @cached_property
    def _edges(self) -> tuple[Int32, Int32]:
        """First and second lane of each pair that follow one another."""
        followers = self.roads.successors
        return np.repeat(np.arange(len(followers), dtype=np.int32), followers.lengths), followers.values

    def after(self, lane: int) -> LaneRows:
        """Lanes that follow a lane."""
        if lane not in self._after:
            self._after[lane] = tuple(self.roads.successors[lane].tolist())
        return self._after[lane]

    def before(self, lane: int) -> LaneRows:
        """Lanes that a lane follows."""
        if lane not in self._before:
            first, second = self._edges
            self._before[lane] = tuple(first[second == lane].tolist())
        return self._before[lane]

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
        return tuple(sorted(lanes, key=lambda lane: -self._along(lane, point, heading)))

    def _along(self, lane: int, point: Float64, heading: float) -> float:
        """Cosine of the angle between a lane at its nearest point and a heading."""
        x, y = point.tolist()
        return _cosine_along(self.roads.lanes[lane], x, y, math.cos(heading), math.sin(heading))


@kernel(allocates=False)
def _cosine_along(line: Float32, x: float, y: float, cos: float, sin: float) -> float:
    """Return the cosine of the angle between a direction and a line (n, 2) at its point nearest to (x, y), or -1."""
    cosine, best = -1.0, np.inf
    for n in range(len(line) - 1):
        x0, y0 = np.float64(line[n, 0]), np.float64(line[n, 1])
        dx, dy = line[n + 1, 0] - x0, line[n + 1, 1] - y0
        square = max(dx * dx + dy * dy, 1e-12)
        share = min(max(((x - x0) * dx + (y - y0) * dy) / square, 0.0), 1.0)
        apart_x, apart_y = x0 + share * dx - x, y0 + share * dy - y
        apart = apart_x * apart_x + apart_y * apart_y
        if apart < best:
            cosine, best = (dx * cos + dy * sin) / math.sqrt(square), apart
    return cosine


@dataclass(frozen=True, eq=False)
class DrivenLanes:
    """Lanes of a drive.

    Attributes:
        graph: The lanes of the map.
        route: The lanes that the centre is on, for each of T moments; the first one counts.
        is_in_lane: (T,) whether the corners of the box are in one lane, or in lanes that follow one another.
    """

    graph: LaneLinks
    route: Sequence[LaneRows]
    is_in_lane: Bool

    @classmethod
    def of(cls, drive: EgoDrive, roads: Roads) -> DrivenLanes:
        """Find the lanes of a drive."""
        graph, around = LaneLinks(roads), _around(roads, drive.corners)
        return cls(graph, driven_route(graph, drive), _is_in_lane(graph, around))

    def progress(self, position: Float64) -> Float64:
        """Movement (T,) along the lane since the moment before [m]; 0 where the lane is new, or there is none.

        Args:
            position: (T, 2) centre of the vehicle [m].
        """
        arcs, progress = self._arcs(position).tolist(), np.zeros(len(position))
        lane, before = (self.route[0][0] if self.route[0] else None), math.nan
        for step, lanes in enumerate(self.route):
            if not lanes:
                continue
            if lanes[0] == lane:
                moved = arcs[step] - before
                is_known = math.isfinite(moved) and arcs[step] != 0.0  # as the owner: an arc of 0 counts as unknown
                progress[step] = moved if is_known else 0.0
                before = arcs[step]
            else:
                lane, before = lanes[0], math.nan
        return progress

    def speed_limit(self) -> Float64:
        """Limit (T,) of the lane [m/s]: of a connector the highest of the lanes it connects; NaN where unknown."""
        limits = {lanes: self._limit(lanes) for lanes in set(self.route)}
        return np.array([limits[lanes] for lanes in self.route])

    def _limit(self, lanes: LaneRows) -> float:
        if not lanes:
            return np.nan
        graph, known = self.graph, self.graph.roads.speed_limit
        if not graph.is_connector[lanes[0]]:
            return float(known[lanes[0]])
        edges = [edge for lane in lanes for edge in (*graph.after(lane), *graph.before(lane))]
        return float(known[edges].max()) if edges and np.isfinite(known[edges]).all() else np.nan

    def _arcs(self, position: Float64) -> Float64:
        """Arc length (T,) on the lane of each moment [m]; NaN without one."""
        arcs = np.full(len(position), np.nan)
        first = np.array([lanes[0] if lanes else -1 for lanes in self.route])
        known = self.graph.roads.lanes
        used = [lane for lane in dict.fromkeys(first.tolist()) if lane >= 0 and known.lengths[lane] > 1]
        if used:
            chosen = known.take(np.array(used))
            owner = np.repeat(np.arange(len(used)), chosen.lengths)
            lines, order = shapely.linestrings(chosen.values, indices=owner), np.argsort(used)
            steps = np.flatnonzero(np.isin(first, used))
            place = order[np.searchsorted(used, first[steps], sorter=order)]
            arcs[steps] = shapely.line_locate_point(lines[place], shapely.points(position[steps]))
        return arcs


def driven_route(graph: LaneLinks, drive: EgoDrive) -> list[LaneRows]:
    """Lanes of the centre, from moment to moment: the same, a follower, or else any around it."""
    around = [here for (here,) in _around(graph.roads, drive.position[:, None])]
    crossing = graph.roads.is_in(drive.position, graph.roads.polygon_type == MapFeatureType.INTERSECTION)
    route: list[LaneRows] = []
    continued: dict[tuple[LaneRows, frozenset[int]], LaneRows] = {}
    for step, here in enumerate(around):  # each moment depends on the one before
        last = route[-1] if route else ()
        if (last, here) not in continued:
            continued[last, here] = graph.continued(last, here)
        lanes = continued[last, here]
        if not lanes:
            lanes = graph.at(here)
            leaves_connector = step > 1 and bool(last) and bool(graph.is_connector[last[0]])
            if leaves_connector and (graph.is_connector[lanes[0]] if lanes else crossing[step]):
                point = shapely.Point(drive.position[step])
                outlines = {lane: shapely.Polygon(graph.roads.polygons[lane]) for lane in last}
                lanes = tuple(lane for lane in last if outlines[lane].distance(point) < _NEAR_CONNECTOR) or lanes
        route.append(graph.by_heading(lanes, drive.position[step], float(drive.heading[step])))
    return _without_other_branches(graph, route)


def _around(roads: Roads, points: Float64) -> list[tuple[frozenset[int], ...]]:
    """Lanes around each of the points (T, K, 2): one set for all points with the same lanes."""
    num_points = points.shape[0] * points.shape[1]
    bits = np.packbits(roads.lanes_around(points), axis=-1)
    width, text = bits.shape[-1], bits.tobytes()
    keys = [text[at : at + width] for at in range(0, len(text), width)] if width else [b""] * num_points
    sets = {key: frozenset(np.flatnonzero(np.unpackbits(np.frombuffer(key, np.uint8))).tolist()) for key in set(keys)}
    found, per_moment = [sets[key] for key in keys], points.shape[1]
    return [tuple(found[at : at + per_moment]) for at in range(0, len(found), per_moment)]


def _without_other_branches(graph: LaneLinks, route: list[LaneRows]) -> list[LaneRows]:
    """Of several lanes keep those on which the drive goes on."""
    for step in range(len(route) - 2, -1, -1):
        lanes, later = route[step], route[step + 1]
        if len(lanes) < 2:
            continue
        if len(later) < len(lanes) and set(later) <= set(lanes):
            route[step] = later
        if later and not graph.is_connector[later[0]]:
            route[step] = tuple(lane for lane in lanes if lane in graph.before(later[0])) or route[step]
    return route


def _is_in_lane(graph: LaneLinks, around: Sequence[tuple[frozenset[int], ...]]) -> Bool:
    """(T,) whether the corners share a lane, or are in lanes that follow one another."""
    found = np.zeros(len(around), np.bool_)
    candidates: LaneRows = ()
    known: dict[tuple[LaneRows, tuple[frozenset[int], ...]], tuple[LaneRows, bool]] = {}
    for step, corners in enumerate(around):  # candidates are the lanes of the moment before
        if step == 1:
            candidates, found[1] = _lanes_of(graph, candidates, corners, is_second=True)
            continue
        if (candidates, corners) not in known:
            known[candidates, corners] = _lanes_of(graph, candidates, corners, is_second=False)
        candidates, found[step] = known[candidates, corners]
    return found


def _lanes_of(
    graph: LaneLinks, candidates: LaneRows, corners: tuple[frozenset[int], ...], *, is_second: bool
) -> tuple[LaneRows, bool]:
    """Lanes of the corners, and whether these share one, or are in lanes that follow one another."""
    lanes: list[LaneRows] = []
    for here in corners:
        of_corner = graph.continued(candidates, here)
        if not of_corner:
            of_corner = graph.at(here)
            if is_second:
                candidates = tuple(dict.fromkeys(candidates + of_corner))
        lanes.append(of_corner)
    is_in_lane = all(lanes) and (
        bool(set.intersection(*map(set, lanes))) or _are_connected(graph, *map(frozenset, lanes))
    )
    return tuple(dict.fromkeys(lane for each in lanes for lane in each)), is_in_lane


def _are_connected(
    graph: LaneLinks,
    front_left: frozenset[int],
    rear_left: frozenset[int],
    rear_right: frozenset[int],
    front_right: frozenset[int],
) -> bool:
    """Whether each front corner is in the lane of the opposite rear corner, or in one that follows it."""
    from_left = rear_left | _joined(graph.after, rear_left)
    from_right = rear_right | _joined(graph.after, rear_right)
    if not (rear_left & from_right or rear_right & from_left):
        return False
    to_left = front_left | _joined(graph.before, front_left)
    to_right = front_right | _joined(graph.before, front_right)
    return bool(to_left & from_right & to_right & from_left)


def _joined(edges: Callable[[int], LaneRows], lanes: frozenset[int]) -> frozenset[int]:
    return frozenset(edge for lane in lanes for edge in edges(lane))
