"""The lane graph as arrays of records, for the traffic kernels."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from scenarionet_data.arrays.dtypes import Bool, Int64, RecordArray
from scenarionet_data.procedural.conflicts import find_conflicts
from scenarionet_data.procedural.roadmap import Lane, RoadMap
from scenarionet_data.procedural.routes import find_routes

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
        ("length", "f8"),  # [m]
        ("step", "f8"),  # distance between points [m]
        ("speed", "f8"),  # desired speed [m/s]: the limit, or less in a bend
        ("closed_from", "f8"),  # part closed by road works [m]; infinite when none is
        ("closed_until", "f8"),
        ("left", "i8"),  # lane beside
        ("right", "i8"),
        ("rank", "i8"),  # priority where lanes conflict: the higher rank goes first
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


class LaneGraph(NamedTuple):
    """L lanes, P points, E links, C conflicts, D destinations.

    Attributes:
        lanes: (L,) ``LANE`` records.
        points: (P,) ``POINT`` records: centrelines, equally spaced along a lane.
        successors: (E,) lanes that follow a lane.
        conflicts: (C,) ``CONFLICT`` records.
        routes: (D, L) ``ROUTE`` records.
        lane_width: [m].
    """

    lanes: RecordArray
    points: RecordArray
    successors: Int64
    conflicts: RecordArray
    routes: RecordArray
    lane_width: float


def make_graph(road_map: RoadMap) -> LaneGraph:
    """Number the lanes of a map in their order and precompute conflicts and routes.

    Destination 0 is the ego's; the others are the map's other ends.
    """
    own = road_map.lanes
    number = {lane.id: row for row, lane in enumerate(own)}
    following: list[list[int]] = [[] for _ in own]
    links = np.zeros((len(own), len(own)), dtype=np.bool_)
    for before, after in road_map.links:
        following[number[before]].append(number[after])
        links[number[before], number[after]] = True
    samples = [lane.samples for lane in own]

    points: RecordArray = np.recarray(sum(len(headings) for _, headings in samples), POINT)
    points.x, points.y = np.concatenate([xy for xy, _ in samples]).T
    points.heading = np.concatenate([headings for _, headings in samples])

    lanes: RecordArray = np.recarray(len(own), LANE)
    lanes.points_begin, lanes.points_end = _ranges([len(headings) for _, headings in samples])
    lanes.successors_begin, lanes.successors_end = _ranges([len(row) for row in following])
    lanes.is_last = lanes.successors_begin == lanes.successors_end
    lanes.length = [lane.path.length for lane in own]
    lanes.step = lanes.length / (lanes.points_end - lanes.points_begin - 1)
    curvature = np.array([lane.path.max_curvature for lane in own])
    bend_speed = np.sqrt(LATERAL_ACCELERATION / np.maximum(curvature, 1e-6))
    limits = [road_map.road.speed_limit if lane.speed_limit is None else lane.speed_limit for lane in own]
    lanes.speed = np.minimum(limits, bend_speed)
    lanes.closed_from = lanes.closed_until = np.inf
    lanes.left = [NONE if lane.left is None else number[lane.left] for lane in own]
    lanes.right = [NONE if lane.right is None else number[lane.right] for lane in own]
    lanes.rank = [lane.rank for lane in own]
    lanes.signal, _ = signal_rows(own)
    lanes.destination = _destinations(road_map, lanes.is_last)
    is_ending = [lane.junction != NONE and lane.rank == 0 and not lane.is_intersection for lane in own]
    lanes.detour = AVOIDED_LANE_COST * np.array(is_ending)

    junction = np.array([lane.junction for lane in own])
    conflicts, crosses = find_conflicts(lanes, points, links, junction, 0.94 * road_map.road.lane_width)
    lanes.needs_grant = crosses | (lanes.signal != NONE)
    successors = np.array([lane for row in following for lane in row], dtype=np.int64)
    routes = find_routes(lanes, successors)
    return LaneGraph(lanes, points, successors, conflicts, routes, road_map.road.lane_width)


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


def _ranges(lengths: list[int]) -> tuple[Int64, Int64]:
    """Begin and end of consecutive ranges."""
    ends = np.cumsum(lengths, dtype=np.int64)
    return ends - np.array(lengths, dtype=np.int64), ends


def _destinations(road_map: RoadMap, is_last: Bool) -> Int64:
    """The destination each lane ends at: lanes that leave the map side by side share one; -1 elsewhere."""
    roads = {lane.end_name: 0 for lane in road_map.lanes if lane.id == road_map.goal[0]}
    destination = np.full(len(is_last), NONE, dtype=np.int64)
    for row, lane in enumerate(road_map.lanes):
        if is_last[row]:
            destination[row] = roads.setdefault(lane.end_name, len(roads))
    return destination
