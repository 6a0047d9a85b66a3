"""The lane graph as arrays of records, for the traffic kernels."""

from __future__ import annotations

from itertools import chain
from typing import NamedTuple

import numpy as np

from scenarionet_data.arrays.dtypes import Bool, Float64, Int64, RecordArray
from scenarionet_data.compiled.decorators import kernel
from scenarionet_data.procedural.roadmap import Lane, RoadMap

NONE = -1
AVOIDED_LANE_COST = 120.0  # [m] of detour a driver accepts to avoid a lane that ends or is closed
LATERAL_ACCELERATION = 2.2  # [m/s2] with which drivers take a bend

LANE = np.dtype(
    [
        ("points_begin", "i8"),  # rows of `LaneGraph.points`
        ("points_end", "i8"),
        ("successors_begin", "i8"),  # rows of `LaneGraph.successors`
        ("successors_end", "i8"),
        ("conflicts_begin", "i8"),  # rows of `LaneGraph.conflicts`
        ("conflicts_end", "i8"),
        ("crossings_begin", "i8"),  # rows of `LaneGraph.crossings`
        ("crossings_end", "i8"),
        ("length", "f8"),  # [m]
        ("step", "f8"),  # distance between points [m]
        ("speed", "f8"),  # desired speed [m/s]: the limit, or less in a bend
        ("closed_from", "f8"),  # part closed by road works [m]; infinite when none is
        ("closed_until", "f8"),
        ("left", "i8"),  # lane beside
        ("right", "i8"),
        ("rank", "i8"),  # priority where lanes conflict: the higher rank goes first
        ("junction", "i8"),  # lanes that may conflict share it; -1 outside junctions
        ("signal", "i8"),  # row of the light that controls entering the lane
        ("destination", "i8"),  # the destination reached at the lane's end
        ("detour", "f8"),  # [m] that drivers accept to avoid the lane
        ("needs_grant", "?"),  # whether entering has to be granted: another lane crosses or has priority
        ("is_last", "?"),  # whether the lane leaves the map
    ],
    align=True,
)
"""A lane of the graph. Lanes are numbered; -1 is none."""

POINT = np.dtype([("x", "f8"), ("y", "f8"), ("heading", "f8")])
"""A point of a centreline [m, m, rad]."""


CROSSING = np.dtype(
    [
        ("lane", "i8"),
        ("walk", "i8"),  # the crosswalk
        ("end", "f8"),  # where it ends along the lane [m]
        ("is_start", "?"),  # whether the lane begins at it
    ],
    align=True,
)
"""A crosswalk over a lane."""


class LaneGraph(NamedTuple):
    """L lanes, P points, E links, C conflicts, D destinations.

    Attributes:
        lanes: (L,) ``LANE`` records.
        points: (P,) ``POINT`` records: centrelines, equally spaced along a lane.
        successors: (E,) lanes that follow a lane.
        conflicts: (C,) ``CONFLICT`` records.
        routes: (D, L) ``ROUTE`` records.
        lane_width: [m].
        crossings: (K,) ``CROSSING`` records, in the order of lanes.
        claims: (W,) number of people on each crosswalk or about to be; the time loop changes it.
        flows: Whether the rules of version 2 hold, with which dense traffic does not lock itself.
    """

    lanes: RecordArray
    points: RecordArray
    successors: Int64
    conflicts: RecordArray
    routes: RecordArray
    lane_width: float
    crossings: RecordArray
    claims: Int64
    flows: bool = True


def make_graph(road_map: RoadMap) -> LaneGraph:
    """Number the lanes of a map in their order and precompute conflicts and routes.

    Destination 0 is the ego's; the others are the map's other ends.
    """
    own, road = road_map.lanes, road_map.road
    number: dict[str, int] = {}
    centrelines, headings, lengths = [], [], []
    for row, lane in enumerate(own):
        number[lane.id] = row
        line, heading = lane.samples
        centrelines.append(line)
        headings.append(heading)
        lengths.append(len(heading))
    points: RecordArray = np.recarray(sum(lengths), POINT)
    points.x, points.y = np.concatenate(centrelines).T
    points.heading = np.concatenate(headings)

    before, after = np.array(list(map(number.get, chain(*road_map.links))), np.int64).reshape(-1, 2).T
    links = np.zeros((len(own), len(own)), np.bool_)
    links[before, after] = True
    successors = after[np.argsort(before, kind="stable")]

    lanes: RecordArray = np.recarray(len(own), LANE)
    lanes.points_begin, lanes.points_end = _ranges(np.array(lengths))
    lanes.successors_begin, lanes.successors_end = _ranges(np.bincount(before, minlength=len(own)))
    lanes.is_last = lanes.successors_begin == lanes.successors_end
    described = [
        (
            lane.path.length,
            lane.path.max_curvature,
            road.speed_limit if lane.speed_limit is None else lane.speed_limit,
            NONE if lane.left is None else number[lane.left],
            NONE if lane.right is None else number[lane.right],
            lane.rank,
            lane.junction,
            lane.is_intersection,
        )
        for lane in own
    ]
    lanes.length, curvature, limit, lanes.left, lanes.right, lanes.rank, lanes.junction, is_inside = np.array(
        described, np.float64
    ).T
    lanes.step = lanes.length / (lanes.points_end - lanes.points_begin - 1)
    lanes.speed = np.minimum(limit, np.sqrt(LATERAL_ACCELERATION / np.maximum(curvature, 1e-6)))
    lanes.closed_from = lanes.closed_until = np.inf
    lanes.signal, _ = signal_rows(own)
    is_ending = (lanes.junction != NONE) & (lanes.rank == 0) & (is_inside == 0)
    lanes.detour = AVOIDED_LANE_COST * is_ending
    # Lanes that leave the map side by side share a destination.
    lanes.destination, ends = NONE, {own[number[road_map.goal[0]]].end_name: 0}
    for row in np.flatnonzero(lanes.is_last).tolist():
        lanes.destination[row] = ends.setdefault(own[row].end_name, len(ends))

    conflicts, crosses = find_conflicts(lanes, points, links, 0.94 * road.lane_width)
    lanes.needs_grant = crosses | (lanes.signal != NONE)
    lanes.crossings_begin = lanes.crossings_end = 0
    routes, nobody = find_routes(lanes, successors), np.zeros(0, np.int64)
    return LaneGraph(lanes, points, successors, conflicts, routes, road.lane_width, np.recarray(0, CROSSING), nobody)


def close_lane(graph: LaneGraph, lane: int, begin: float, end: float) -> LaneGraph:
    """Return the graph with a lane closed from ``begin`` to ``end`` [m]; routes avoid it where possible."""
    lanes = graph.lanes.copy()
    lanes.closed_from[lane], lanes.closed_until[lane] = begin, end
    lanes.detour[lane] += AVOIDED_LANE_COST
    return graph._replace(lanes=lanes, routes=find_routes(lanes, graph.successors))


def signal_rows(lanes: list[Lane]) -> tuple[Int64, list[tuple[int, int]]]:
    """Return the light row of each lane, and the (junction, axis) of each row."""
    rows: dict[tuple[int, int], int] = {}
    signal = np.full(len(lanes), NONE, dtype=np.int64)
    for number, lane in enumerate(lanes):
        if lane.axis != NONE:
            signal[number] = rows.setdefault((lane.junction, lane.axis), len(rows))
    return signal, list(rows)


def _ranges(lengths: Int64) -> tuple[Int64, Int64]:
    """Begin and end of consecutive ranges."""
    ends = np.cumsum(lengths)
    return ends - lengths, ends


CROSS, SPLIT, MERGE = 0, 1, 2
_SAME_POINT = 0.5  # [m]
_MARGIN = 1.5  # [m] added to both ends of a zone: points are up to 2 m apart

CONFLICT = np.dtype(
    [
        ("lane", "i8"),  # the other lane
        ("kind", "i8"),  # CROSS, SPLIT or MERGE
        ("own_begin", "f8"),  # [m] along the own lane
        ("own_end", "f8"),
        ("other_begin", "f8"),  # [m] along the other lane
        ("other_end", "f8"),
    ]
)


def find_conflicts(lanes: RecordArray, points: RecordArray, links: Bool, clearance: float) -> tuple[RecordArray, Bool]:
    """Find lanes of one junction, or with one start, whose centrelines come within ``clearance``.

    Args:
        lanes: (L,) ``LANE`` records; their range of conflicts is written.
        points: (P,) ``POINT`` records.
        links: (L, L) whether a lane leads to another.
        clearance: Distance of centrelines below which two vehicles would touch [m].

    Returns:
        ``CONFLICT`` records, in the order of the own lane, and (L,) whether entering a lane has to be granted.
    """
    xy = np.stack([points.x, points.y], axis=-1)
    starts, ends = xy[lanes.points_begin], xy[lanes.points_end - 1]
    has_one_start, has_one_end = _are_near(starts), _are_near(ends)
    is_candidate = has_one_start | ((lanes.junction >= 0) & (lanes.junction[:, None] == lanes.junction))
    is_candidate &= ~(links | links.T | np.eye(len(lanes), dtype=np.bool_))
    pairs = np.ascontiguousarray(np.argwhere(is_candidate))
    zones = np.empty((len(pairs), 4), np.int64)
    _find_zones(xy, lanes.points_begin, lanes.points_end, pairs, clearance * clearance, zones)
    pairs, zones = pairs[zones[:, 0] >= 0], zones[zones[:, 0] >= 0]
    own, other = pairs.T
    conflicts: RecordArray = np.recarray(len(pairs), CONFLICT)
    conflicts.lane = other
    conflicts.kind = np.where(has_one_start[own, other], SPLIT, np.where(has_one_end[own, other], MERGE, CROSS))
    margins = np.array([-_MARGIN, _MARGIN, -_MARGIN, _MARGIN])
    steps = lanes.step[pairs].repeat(2, axis=1)
    conflicts.own_begin, conflicts.own_end, conflicts.other_begin, conflicts.other_end = (zones * steps + margins).T
    lanes.conflicts_end = np.searchsorted(own, np.arange(len(lanes)), side="right")
    lanes.conflicts_begin = np.searchsorted(own, np.arange(len(lanes)), side="left")
    gives_way = (conflicts.kind == MERGE) & (lanes.rank[own] <= lanes.rank[other])
    needs_grant = np.zeros(len(lanes), dtype=np.bool_)
    needs_grant[own[(conflicts.kind == CROSS) | gives_way]] = True
    return conflicts, needs_grant


def _are_near(places: Float64) -> Bool:
    """(L, L) which of the points (L, 2) are the same, within tolerance."""
    near: Bool = np.hypot(*(places[:, None] - places).transpose(2, 0, 1)) < _SAME_POINT
    return near


@kernel
def _find_zones(xy: Float64, begin: Int64, end: Int64, pairs: Int64, square: float, zones: Int64) -> None:
    """First and last point of lane ``a`` and of ``b`` nearer than a distance to the other lane; -1 when none is.

    Args:
        xy: (P, 2) points of all lanes [m].
        begin, end: (L,) range of each lane's points.
        pairs: (K, 2) lanes a and b.
        square: Of the distance [m2].
        zones: (K, 4), written: first and last point of a, first and last point of b.
    """
    for row in range(len(pairs)):
        a, b = pairs[row, 0], pairs[row, 1]
        low_a, high_a, low_b, high_b = -1, -1, end[b] - begin[b], -1
        for i in range(end[a] - begin[a]):
            x, y = xy[begin[a] + i, 0], xy[begin[a] + i, 1]
            for j in range(end[b] - begin[b]):
                if (x - xy[begin[b] + j, 0]) ** 2 + (y - xy[begin[b] + j, 1]) ** 2 < square:
                    low_a = i if low_a < 0 else low_a
                    high_a = i
                    low_b, high_b = min(low_b, j), max(high_b, j)
        zones[row, 0], zones[row, 1], zones[row, 2], zones[row, 3] = low_a, high_a, low_b, high_b


LANE_CHANGE_COST = 80.0  # [m] of detour a driver accepts rather than change lanes

ROUTE = np.dtype([("cost", "f8"), ("next_lane", "i8")])
"""Cost from a lane to a destination [m], infinite where unreachable, and the successor to take, -1 for none."""


def find_routes(lanes: RecordArray, successors: Int64) -> RecordArray:
    """Find the cheapest routes to all destinations.

    Args:
        lanes: (L,) ``LANE`` records.
        successors: (E,) of all lanes.

    Returns:
        (D, L) ``ROUTE`` records.
    """
    routes: RecordArray = np.recarray((int(lanes.destination.max()) + 1, len(lanes)), ROUTE)
    routes.cost, routes.next_lane = np.inf, -1
    _relax(lanes, successors, routes)
    return routes


@kernel
def _relax(lanes: RecordArray, successors: Int64, routes: RecordArray) -> None:
    """Bellman-Ford from every destination backwards."""
    for goal in range(len(routes)):
        changed = True
        while changed:
            changed = False
            for number in range(len(lanes) - 1, -1, -1):
                lane, route = lanes[number], routes[goal, number]
                length = lane.length + lane.detour
                best = length if lane.destination == goal else np.inf
                for e in range(lane.successors_begin, lane.successors_end):
                    through = length + routes[goal, successors[e]].cost
                    if through < best:
                        best = through
                        route.next_lane = successors[e]
                if lane.left >= 0:
                    best = min(best, routes[goal, lane.left].cost + LANE_CHANGE_COST)
                if lane.right >= 0:
                    best = min(best, routes[goal, lane.right].cost + LANE_CHANGE_COST)
                if best < route.cost - 1e-9:
                    route.cost = best
                    changed = True
