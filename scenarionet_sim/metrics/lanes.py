"""The lanes that a drive is on, and what nuPlan's metrics derive from them.

Source: nuplan-devkit, ``planning/metrics/utils/route_extractor.py``, ``ego_lane_change.py``,
``driving_direction_compliance.py`` and ``speed_limit_compliance.py`` (definitions). In nuPlan's maps only lane
connectors overlap, in those of other datasets any lanes do: all that contain a point are candidates, and the one
along the heading counts first.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise

import numpy as np
import shapely

from scenarionet_data.arrays.dtypes import Bool, Float32, Float64, Int32, IntP
from scenarionet_data.compiled.decorators import kernel
from scenarionet_data.scenario.vocabulary import MapFeatureType
from scenarionet_sim.metrics.drive import EgoDrive
from scenarionet_sim.metrics.lane_links import LaneLinks, LaneRows, arcs_of_points, nearest_arc
from scenarionet_sim.roads.roads import Roads

_NEAR_CONNECTOR = 5.0  # [m] from a connector a vehicle is still assigned to it, while in an intersection


@dataclass(frozen=True)
class LaneChange:
    """A lane change: nuPlan's ``ego_lane_change``.

    Attributes:
        start, end: Moment at which the first corner has left the lane, and at which all are in one again.
        is_completed: Whether it ends in a lane that is neither the first one nor a follower of it; not in the first
            one again, off all lanes, or with the drive.
    """

    start: int
    end: int
    is_completed: bool


@dataclass(frozen=True, eq=False)
class DrivenLanes:
    """Lanes of a drive.

    Attributes:
        graph: The lanes of the map.
        route: The lanes that the centre is on, for each of T moments; the first one counts.
        shared: The lanes that all corners of the box are in or, in lanes that follow one another, between, for each
            moment; none off all lanes, None if the corners are in different lanes.
        on_lane: (T, 4) whether each corner is on a lane.
    """

    graph: LaneLinks
    route: Sequence[LaneRows]
    shared: Sequence[frozenset[int] | None]
    on_lane: Bool

    @classmethod
    def of(cls, drive: EgoDrive, roads: Roads) -> DrivenLanes:
        """Find the lanes of a drive."""
        graph, stays = roads.once(LaneLinks), _stays(roads, drive.corners)
        on_lane = np.array([[bool(lanes) for lanes in stay.lanes] for stay in stays]).reshape(-1, 4)
        moments = [stay.end - stay.first for stay in stays]
        return cls(graph, driven_route(graph, drive), _shared(graph, stays), np.repeat(on_lane, moments, axis=0))

    @cached_property
    def is_in_lane(self) -> Bool:
        """(T,) whether the corners of the box are in one lane, or in lanes that follow one another."""
        return np.array([bool(lanes) for lanes in self.shared], np.bool_)

    def lane_changes(self) -> list[LaneChange]:
        """Lane changes, also those that are not completed."""
        found: list[LaneChange] = []
        start, first = 0, frozenset[int]()
        for step, (before, now) in enumerate(pairwise(self.shared), 1):  # one ends before the next begins
            if not first and now is None and before:
                start, first = step, before
            elif first and now is not None:
                stayed = first | _joined(self.graph.after, first)
                found.append(LaneChange(start, step, bool(now) and not now & stayed))
                first = frozenset()
        return [*found, LaneChange(start, len(self.shared) - 1, False)] if first else found

    def progress(self, position: Float64) -> Float64:
        """Movement (T,) along the lane since the moment before [m]; 0 where the lane is new, or there is none.

        Args:
            position: (T, 2) centre of the vehicle [m].
        """
        progress, lane = np.zeros(len(position)), np.array([lanes[0] if lanes else -1 for lanes in self.route], np.intp)
        roads = self.graph.roads
        _find_progress(position, lane, roads.lanes.values, roads.lanes.offsets, roads.once(arcs_of_points), progress)
        return progress

    def speed_limit(self) -> Float64:
        """Limit (T,) of the lane [m/s]: of a connector the highest of the lanes it connects; NaN where unknown."""
        graph, known = self.graph, self.graph.roads.speed_limit
        limits: dict[LaneRows, float] = {(): np.nan}
        for lanes in {*self.route} - {()}:
            limits[lanes] = float(known[lanes[0]])
            if graph.is_connector[lanes[0]]:
                edges = [edge for lane in lanes for edge in (*graph.after(lane), *graph.before(lane))]
                limits[lanes] = float(known[edges].max()) if edges else np.nan  # which is that of any unknown
        return np.array([limits[lanes] for lanes in self.route])


@kernel(allocates=False)
def _find_progress(
    position: Float64, lane: IntP, points: Float32, offsets: Int32, along: Float64, progress: Float64
) -> None:
    """Write the movement (T,) along the lane since the last moment on one, by the nearest points on the lanes.

    The arc where the lane is new counts as unknown, and, as the owner has it, an arc of 0.

    Args:
        position: (T, 2) [m].
        lane: (T,) row of the lane, or -1.
        points, offsets: The lanes.
        along: (P,) arc length of the points [m].
        progress: Output, zeros before.
    """
    last = 0  # row of the nearest segment of the moment before
    before, arc_before, was_same = lane[0] if len(lane) else -1, np.nan, False
    for t in range(len(position)):
        if lane[t] < 0:
            continue
        is_same = lane[t] == before
        first, end = offsets[lane[t]], offsets[lane[t] + 1]
        arc, _, last = nearest_arc(position[t, 0], position[t, 1], points, along, first, end, last)
        if is_same and was_same and arc != 0.0 and np.isfinite(arc - arc_before):
            progress[t] = arc - arc_before
        before, arc_before, was_same = lane[t], arc, is_same


def driven_route(graph: LaneLinks, drive: EgoDrive) -> list[LaneRows]:
    """Lanes of the centre, from moment to moment: the same, a follower, or else any around it; found once."""
    known: dict[LaneLinks, list[LaneRows]] = vars(drive).setdefault("_routes", {})
    if graph in known:
        return known[graph]
    route: list[LaneRows] = []
    for stay in _stays(graph.roads, drive.position[:, None]):
        (here,) = stay.lanes
        for step in range(stay.first, stay.end):  # each moment depends on the one before
            last = route[-1] if route else ()
            lanes = continued = graph.continued(last, here)
            if not lanes:
                lanes = _entered(graph, drive, step, last, here)
            route.append(graph.by_heading(lanes, drive.position[step], float(drive.heading[step])))
            if lanes == last and continued == lanes and len(lanes) < 2:  # as nothing changes until the end of the stay
                route += [lanes] * (stay.end - step - 1)
                break
    known[graph] = _without_other_branches(graph, route)
    return known[graph]


def _entered(graph: LaneLinks, drive: EgoDrive, step: int, last: LaneRows, here: frozenset[int]) -> LaneRows:
    """Lanes of a moment that do not continue those of the moment before."""
    lanes, roads = graph.at(here), graph.roads
    if step < 2 or not last or not graph.is_connector[last[0]]:
        return lanes
    position = drive.position[step]
    if lanes:
        is_crossing = bool(graph.is_connector[lanes[0]])
    else:
        is_crossing = bool(roads.is_in(position, roads.polygon_type == MapFeatureType.INTERSECTION))
    if not is_crossing:
        return lanes
    point = shapely.Point(position)
    outlines = {lane: shapely.Polygon(roads.polygons[lane]) for lane in last}
    return tuple(lane for lane in last if outlines[lane].distance(point) < _NEAR_CONNECTOR) or lanes


@dataclass(frozen=True, eq=False)
class _Stay:
    """Moments ``first`` to ``end`` (exclusive) at which K points stay in the same lanes."""

    first: int
    end: int
    lanes: tuple[frozenset[int], ...]


def _stays(roads: Roads, points: Float64) -> list[_Stay]:
    """Return the stays of points (T, K, 2) [m] in lanes, in order of time."""
    first, lanes = roads.stays_in_lanes(points)
    values, count = lanes.values.tolist(), points.shape[1]
    around = [frozenset(values[start:end]) for start, end in pairwise(lanes.offsets.tolist())]
    ends = [*first[1:].tolist(), len(points)]
    return [
        _Stay(start, end, tuple(around[count * number : count * (number + 1)]))
        for number, (start, end) in enumerate(zip(first.tolist(), ends, strict=True))
    ]


def _without_other_branches(graph: LaneLinks, route: list[LaneRows]) -> list[LaneRows]:
    """Of several lanes keep those on which the drive goes on."""
    if max(map(len, {*route}), default=0) < 2:
        return route
    several = [step for step, lanes in enumerate(route[:-1]) if len(lanes) > 1]
    for step in reversed(several):
        lanes, later = route[step], route[step + 1]
        if len(later) < len(lanes) and set(later) <= set(lanes):
            route[step] = later
        if later and not graph.is_connector[later[0]]:
            route[step] = tuple(lane for lane in lanes if lane in graph.before(later[0])) or route[step]
    return route


def _shared(graph: LaneLinks, stays: Sequence[_Stay]) -> list[frozenset[int] | None]:
    """Return ``DrivenLanes.shared`` of the corners."""
    found: list[frozenset[int] | None] = []
    candidates: LaneRows = ()
    for stay in stays:
        for step in range(stay.first, stay.end):  # candidates are the lanes of the moment before
            before = candidates
            candidates, lanes = _lanes_of(graph, before, stay.lanes, is_second=step == 1)
            found.append(lanes)
            if candidates == before and step > 1:  # as nothing changes until the end of the stay
                found += [lanes] * (stay.end - step - 1)
                break
    return found


def _lanes_of(
    graph: LaneLinks, candidates: LaneRows, corners: tuple[frozenset[int], ...], *, is_second: bool
) -> tuple[LaneRows, frozenset[int] | None]:
    """Lanes of the corners, and those that they share, or are between in lanes that follow one another."""
    lanes: list[LaneRows] = []
    for here in corners:
        of_corner = graph.continued(candidates, here)
        if not of_corner:
            of_corner = graph.at(here)
            if is_second:
                candidates = tuple(dict.fromkeys(candidates + of_corner))
        lanes.append(of_corner)
    shared: frozenset[int] | None = frozenset()
    if any(lanes):
        each = [frozenset(of_corner) for of_corner in lanes]
        shared = (all(lanes) and (frozenset.intersection(*each) or _connecting(graph, *each))) or None
    return tuple(dict.fromkeys(lane for each in lanes for lane in each)), shared


def _connecting(
    graph: LaneLinks,
    front_left: frozenset[int],
    rear_left: frozenset[int],
    rear_right: frozenset[int],
    front_right: frozenset[int],
) -> frozenset[int]:
    """Lanes of the rear corners, or following these, that front corners are in, or in followers, crosswise."""
    from_left = rear_left | _joined(graph.after, rear_left)
    from_right = rear_right | _joined(graph.after, rear_right)
    if not (rear_left & from_right or rear_right & from_left):
        return frozenset()
    to_left = front_left | _joined(graph.before, front_left)
    to_right = front_right | _joined(graph.before, front_right)
    return to_left & from_right & to_right & from_left


def _joined(edges: Callable[[int], LaneRows], lanes: frozenset[int]) -> frozenset[int]:
    return frozenset(edge for lane in lanes for edge in edges(lane))
