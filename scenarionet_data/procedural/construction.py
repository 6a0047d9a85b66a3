"""Road works and breakdowns: cones and barriers that close part of a lane, or are placed on the shoulder."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from scenarionet_data.arrays.dtypes import Float64
from scenarionet_data.procedural.graph import NONE, LaneGraph, close_lane
from scenarionet_data.procedural.roadmap import NO_JUNCTION, Lane, RoadMap
from scenarionet_data.procedural.routes import LANE_CHANGE_COST
from scenarionet_data.scenario.vocabulary import ObjectType

CONE = (0.35, 0.35, 0.7)  # [m] length, width, height
BARRIER = (1.6, 0.4, 1.0)
BROKEN_CAR = (4.6, 1.85, 1.5)
TAPER = 12.0  # [m] over which cones close the lane
WORKS = 12.0  # [m] behind the taper
APPROACH = 30.0  # [m] of lane ahead of a closure, to see it and change lanes
_CONES = 5


@dataclass(frozen=True)
class Obstacle:
    """A stationary object: type, name, position [m], heading [rad], and length, width and height [m]."""

    type: ObjectType
    word: str
    x: float
    y: float
    heading: float
    size: tuple[float, float, float]


def place_construction(
    road_map: RoadMap, graph: LaneGraph, probability: float, rng: np.random.Generator
) -> tuple[LaneGraph, list[Obstacle]]:
    """Decide at random whether there are road works, and place them on an outermost lane of the ego's route.

    A lane is closed where traffic can avoid it; otherwise the works are on the shoulder.

    Returns:
        The graph, with the closed lane if any, and the obstacles.
    """
    if rng.random() >= probability:
        return graph, []
    candidates = _candidates(road_map, graph)
    if not candidates:
        return graph, []
    closable = [number for number in candidates if _is_closable(road_map, graph, number)]
    number = int(rng.choice(closable or candidates))
    lane, width = road_map.lanes[number], road_map.road.lane_width
    is_breakdown = bool(rng.random() < 0.4)
    latest = graph.lanes.length[number] - TAPER - WORKS
    if closable:
        begin = float(rng.uniform(APPROACH, latest))
        closed = close_lane(graph, number, begin - 2.0, begin + TAPER + WORKS)
        return closed, _close_lane(lane, begin, width, is_breakdown)
    begin = float(rng.uniform(0.5, 1.0)) * latest
    return graph, _off_lanes(graph, _on_shoulder(lane, begin, width, is_breakdown))


def _candidates(road_map: RoadMap, graph: LaneGraph) -> list[int]:
    """Outermost lanes outside junctions, long enough, on which the ego's destination can be reached.

    The ego's first lane is excluded: it leaves no room to change lanes before the works.
    """
    return [
        number
        for number, lane in enumerate(road_map.lanes)
        if lane.junction == NO_JUNCTION
        and graph.lanes.right[number] == NONE
        and graph.lanes.length[number] > TAPER + WORKS + 3.0
        and np.isfinite(graph.routes.cost[0, number])
        and graph.lanes.conflicts_begin[number] == graph.lanes.conflicts_end[number]
        and lane.id not in road_map.start
    ]


def _is_closable(road_map: RoadMap, graph: LaneGraph, number: int) -> bool:
    """Whether traffic has room and a lane to change to, and no route requires this lane."""
    beside = graph.lanes.left[number]
    if beside == NONE or graph.lanes.length[number] < APPROACH + TAPER + WORKS:
        return False
    exits = graph.successors[graph.lanes.successors_begin[number] : graph.lanes.successors_end[number]]
    is_plain = all(road_map.lanes[after].junction == NO_JUNCTION for after in exits)
    return is_plain and abs(graph.routes.cost[0, number] - graph.routes.cost[0, beside]) < LANE_CHANGE_COST / 2.0


def _close_lane(lane: Lane, begin: float, width: float, is_breakdown: bool) -> list[Obstacle]:
    """Return a taper of cones across the lane, followed by barriers and cones, or a car, in the closed part."""
    edge = 0.5 * width - 0.45
    shares = np.linspace(0.0, 1.0, _CONES)
    obstacles = [_cone(lane, begin + share * TAPER, (2.0 * share - 1.0) * edge) for share in shares]
    obstacles += [_cone(lane, begin + TAPER + share * WORKS, edge) for share in shares[1:]]
    obstacles += [_barrier(lane, begin + TAPER + 0.5, left) for left in (-0.85, 0.85)]
    if is_breakdown:
        obstacles.append(_broken_car(lane, begin + TAPER + WORKS - 4.0, 0.0))
    return obstacles


def _on_shoulder(lane: Lane, begin: float, width: float, is_breakdown: bool) -> list[Obstacle]:
    """Return cones along the edge, and a barrier or a car beyond it."""
    beyond = -0.5 * width
    obstacles = [_cone(lane, begin + k * (TAPER + WORKS) / _CONES, beyond - 0.25) for k in range(_CONES)]
    if is_breakdown:
        obstacles.append(_broken_car(lane, begin + TAPER, beyond - 1.5))
        return obstacles
    return [*obstacles, _barrier(lane, begin + TAPER, beyond - 1.3)]


def _off_lanes(graph: LaneGraph, obstacles: list[Obstacle]) -> list[Obstacle]:
    """Keep obstacles that do not block a lane, for example a ramp next to the road."""
    places = np.array([(obstacle.x, obstacle.y) for obstacle in obstacles])
    distance = np.hypot(graph.points.x[:, None] - places[:, 0], graph.points.y[:, None] - places[:, 1]).min(axis=0)
    half = graph.lane_width / 2.0
    return [
        obstacle
        for obstacle, gap in zip(obstacles, distance, strict=True)
        if gap > half + obstacle.size[obstacle.type == ObjectType.VEHICLE] / 2.0  # only a car is parallel to the lane
    ]


def _cone(lane: Lane, s: float, left: float) -> Obstacle:
    return _place(lane, s, left, ObjectType.TRAFFIC_CONE, "cone", CONE, 0.0)


def _barrier(lane: Lane, s: float, left: float) -> Obstacle:
    return _place(lane, s, left, ObjectType.TRAFFIC_BARRIER, "barrier", BARRIER, math.pi / 2.0)


def _broken_car(lane: Lane, s: float, left: float) -> Obstacle:
    return _place(lane, s, left, ObjectType.VEHICLE, "broken-down car", BROKEN_CAR, 0.0)


def _place(
    lane: Lane,
    s: float,
    left: float,
    kind: ObjectType,
    word: str,
    size: tuple[float, float, float],
    turn: float,
) -> Obstacle:
    pose = lane.path.pose_at(float(s)).moved(0.0, float(left), turn)
    return Obstacle(kind, word, pose.x, pose.y, pose.heading, size)


def boxes(obstacles: list[Obstacle]) -> tuple[Float64, Float64]:
    """Return (N, 3) x, y, heading and (N, 3) sizes of obstacles."""
    poses = np.array([(o.x, o.y, o.heading) for o in obstacles], dtype=np.float64).reshape(-1, 3)
    return poses, np.array([o.size for o in obstacles], dtype=np.float64).reshape(-1, 3)
