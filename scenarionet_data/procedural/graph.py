"""The lane graph as flat arrays: what the traffic kernels drive on."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from scenarionet_data.arrays.dtypes import Bool, Float64, Int32
from scenarionet_data.procedural.conflicts import find_conflicts
from scenarionet_data.procedural.roadmap import Lane, RoadMap
from scenarionet_data.procedural.routes import find_routes

NONE = -1
AVOIDED_LANE_COST = 120.0  # [m] of detour a driver accepts to avoid a lane that ends or is closed
LATERAL_ACCELERATION = 2.2  # [m/s2] with which drivers take a bend


class LaneGraph(NamedTuple):
    """L lanes, P points, D destinations. Lanes, points, exits and conflicts are numbered; -1 is none.

    Attributes:
        first: (L + 1,) a lane's points are ``x[first[l]:first[l + 1]]``, equally spaced by ``step[l]``.
        x, y, heading: (P,) centrelines [m, rad].
        length, step: (L,) [m].
        speed: (L,) desired speed [m/s]: the limit, or less in a bend.
        exit_first, exit_to: successors of lane l are ``exit_to[exit_first[l]:exit_first[l + 1]]``.
        left, right: (L,) lanes beside.
        rank: (L,) who goes first where lanes conflict.
        signal: (L,) row of the light that controls entering the lane.
        needs_grant: (L,) whether entering has to be granted: something may cross or has priority.
        conflict_first: (L + 1,), conflicts: rows (other lane, kind), conflict_zones: rows (own begin, own end,
            other begin, other end) [m] along the lanes.
        cost: (D, L) [m] to a destination, lane changes counted as detours; infinite when there is no way.
        next_lane: (D, L) the successor that leads to a destination.
        blocked: (L, 2) [m] begin and end of the part closed by road works; infinite when none is.
        detour: (L,) [m] what drivers accept to avoid the lane.
        destination: (L,) the destination reached at the lane's end.
        lane_width: [m].
    """

    first: Int32
    x: Float64
    y: Float64
    heading: Float64
    length: Float64
    step: Float64
    speed: Float64
    exit_first: Int32
    exit_to: Int32
    left: Int32
    right: Int32
    rank: Int32
    signal: Int32
    needs_grant: Bool
    conflict_first: Int32
    conflicts: Int32
    conflict_zones: Float64
    cost: Float64
    next_lane: Int32
    blocked: Float64
    detour: Float64
    destination: Int32
    lane_width: float


def make_graph(road_map: RoadMap) -> LaneGraph:
    """Number the lanes of a map in their order and precompute conflicts and routes.

    Destination 0 is the ego's; the others are the map's other ends.
    """
    lanes = road_map.lanes
    number = {lane.id: row for row, lane in enumerate(lanes)}
    samples = [lane.samples for lane in lanes]
    first = _offsets([len(points) for points, _ in samples])
    points = np.concatenate([points for points, _ in samples])
    length = np.array([lane.path.length for lane in lanes])
    exit_first, exit_to = _exits(road_map, number)
    left, right = (_numbers([getattr(lane, side) for lane in lanes], number) for side in ("left", "right"))
    rank = np.array([lane.rank for lane in lanes], dtype=np.int32)
    junction = np.array([lane.junction for lane in lanes], dtype=np.int32)
    signal, _ = signal_rows(lanes)
    step = length / (np.diff(first) - 1)
    conflict_first, conflicts, zones, needs_grant = find_conflicts(
        first, points, step, exit_first, exit_to, junction, rank, 0.94 * road_map.road.lane_width
    )
    destination = _destinations(road_map, np.diff(exit_first) == 0)
    ending = np.array([lane.junction != NONE and lane.rank == 0 and not lane.is_intersection for lane in lanes])
    detour = AVOIDED_LANE_COST * ending
    cost, next_lane = find_routes(
        length + detour, exit_first, exit_to, left, right, destination, int(destination.max()) + 1
    )
    return LaneGraph(
        first=first,
        x=points[:, 0].copy(),
        y=points[:, 1].copy(),
        heading=np.concatenate([headings for _, headings in samples]),
        length=length,
        step=step,
        speed=_speeds(lanes, road_map.road.speed_limit),
        exit_first=exit_first,
        exit_to=exit_to,
        left=left,
        right=right,
        rank=rank,
        signal=signal,
        needs_grant=needs_grant | (signal != NONE),
        conflict_first=conflict_first,
        conflicts=conflicts,
        conflict_zones=zones,
        cost=cost,
        next_lane=next_lane,
        blocked=np.full((len(lanes), 2), np.inf),
        detour=detour,
        destination=destination,
        lane_width=road_map.road.lane_width,
    )


def close_lane(graph: LaneGraph, lane: int, begin: float, end: float) -> LaneGraph:
    """The graph with a lane closed from ``begin`` to ``end`` [m]: routes lead past it where there is a way."""
    blocked, detour = graph.blocked.copy(), graph.detour.copy()
    blocked[lane] = begin, end
    detour[lane] += AVOIDED_LANE_COST
    beside = graph.left, graph.right
    cost, next_lane = find_routes(
        graph.length + detour, graph.exit_first, graph.exit_to, *beside, graph.destination, len(graph.cost)
    )
    return graph._replace(blocked=blocked, detour=detour, cost=cost, next_lane=next_lane)


def signal_rows(lanes: list[Lane]) -> tuple[Int32, list[tuple[int, int]]]:
    """The light row of each lane, and the (junction, axis) of each row."""
    rows: dict[tuple[int, int], int] = {}
    signal = np.full(len(lanes), NONE, dtype=np.int32)
    for number, lane in enumerate(lanes):
        if lane.axis != NONE:
            signal[number] = rows.setdefault((lane.junction, lane.axis), len(rows))
    return signal, list(rows)


def _offsets(lengths: list[int]) -> Int32:
    return np.concatenate([[0], np.cumsum(lengths)]).astype(np.int32)


def _exits(road_map: RoadMap, number: dict[str, int]) -> tuple[Int32, Int32]:
    exits: list[list[int]] = [[] for _ in number]
    for before, after in road_map.links:
        exits[number[before]].append(number[after])
    return _offsets([len(row) for row in exits]), np.array([lane for row in exits for lane in row], dtype=np.int32)


def _numbers(ids: list[str | None], number: dict[str, int]) -> Int32:
    return np.array([NONE if lane is None else number[lane] for lane in ids], dtype=np.int32)


def _speeds(lanes: list[Lane], limit: float) -> Float64:
    curvature = np.array([lane.path.max_curvature for lane in lanes])
    gentle: Float64 = np.minimum(limit, np.sqrt(LATERAL_ACCELERATION / np.maximum(curvature, 1e-6)))
    return gentle


def _destinations(road_map: RoadMap, is_end: Bool) -> Int32:
    """The destination each lane ends at: lanes that leave the map side by side share one; -1 elsewhere."""
    roads: dict[str, int] = {road_map.goal[0].rstrip("0123456789"): 0}
    destination = np.full(len(is_end), NONE, dtype=np.int32)
    for row, lane in enumerate(road_map.lanes):
        if is_end[row]:
            destination[row] = roads.setdefault(lane.id.rstrip("0123456789"), len(roads))
    return destination
