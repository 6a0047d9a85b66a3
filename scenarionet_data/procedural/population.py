"""What is on the roads of a scenario: vehicles with their kinds, start positions and destinations, and road works."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from scenarionet_data.arrays.dtypes import Bool, Float64, Int64, RecordArray
from scenarionet_data.procedural.graph import LANE_CHANGE_COST, NONE, LaneGraph, close_lane
from scenarionet_data.procedural.options import GeneratorOptions
from scenarionet_data.procedural.roadmap import NO_JUNCTION, Obstacle, RoadMap
from scenarionet_data.procedural.vehicles import VEHICLE
from scenarionet_data.scenario.vocabulary import ObjectType

_KINDS = np.array(["car", "van", "truck", "bus", "motorcycle", "cyclist"])
CYCLIST = 5
_SHARES = np.array([0.74, 0.14, 0.08, 0.04])
_MOTORCYCLES = 0.03
_RANGES = np.array(
    [
        [(4.1, 5.0), (1.75, 1.95), (1.4, 1.65), (1.4, 2.2)],
        [(4.9, 5.8), (1.95, 2.05), (1.9, 2.4), (1.1, 1.6)],
        [(6.5, 8.5), (2.2, 2.4), (2.7, 3.4), (0.8, 1.1)],
        [(9.0, 10.5), (2.4, 2.5), (3.0, 3.2), (0.9, 1.2)],
        [(2.0, 2.3), (0.75, 0.9), (1.4, 1.7), (1.8, 2.2)],
        [(1.7, 1.9), (0.55, 0.7), (1.6, 1.9), (0.6, 1.0)],
    ]
)
"""Share of each kind in traffic; (6, 4, 2) least and greatest length, width, height [m] and acceleration [m/s2]."""
ROOM = 3.0  # [m] bumper to bumper between vehicles at the start, at least
END_ROOM = 6.0  # [m] free of vehicles' centres at both ends of a lane, at the start
_TRIES = 20
WARM_UP = 20.0
"""Time before the ego enters [s], in which queues at lights form; it is not recorded."""
_LEAST_HEADWAY = 1.0  # [s] between arrivals on a lane
_PACE = 0.33  # mean over desired speed, with stops and turns
_CYCLING = 3.5, 6.5  # [m/s] slowest and fastest cyclist
_FROM_THE_EDGE = 0.8  # [m] at which cyclists keep from the lane's right side
_AT_THE_END = 0.2  # [m] of lane behind a vehicle that enters

TAPER = 12.0  # [m] over which cones close the lane
WORKS = 12.0  # [m] behind the taper
APPROACH = 30.0  # [m] of lane ahead of a closure, to see it and change lanes
_CONES = 5
_CONE = ObjectType.TRAFFIC_CONE, "cone", (0.35, 0.35, 0.7), 0.0
_BARRIER = ObjectType.TRAFFIC_BARRIER, "barrier", (1.6, 0.4, 1.0), math.pi / 2.0
_BROKEN_CAR = ObjectType.VEHICLE, "broken-down car", (4.6, 1.85, 1.5), 0.0
"""Type, name, length, width and height [m] of obstacles, and how they are turned to the lane [rad]."""


@dataclass(frozen=True, eq=False)
class Population:
    """Vehicles of a scenario, the ego first, and then people on foot.

    Attributes:
        kinds: Names of the kinds of all.
        size: (N, 3) length, width, height [m].
        vehicles: (V,) ``VEHICLE`` records.
        arrivals: (V,) timestep from which each wants to enter; 0 for those that are there at the start.
    """

    kinds: list[str]
    size: Float64
    vehicles: RecordArray
    arrivals: Int64

    def select(self, chosen: Bool) -> Population:
        """Return some of the vehicles and people (N,)."""
        kinds, wheeled = np.array(self.kinds)[chosen].tolist(), chosen[: len(self.vehicles)]
        return Population(kinds, self.size[chosen], self.vehicles[wheeled], self.arrivals[wheeled])


def populate(
    road_map: RoadMap, graph: LaneGraph, options: GeneratorOptions, rng: np.random.Generator, flow_for: float = 0.0
) -> Population:
    """Draw the vehicles: the ego on the first road, the others on all roads by density.

    They start at speeds that the time loop lowers where necessary, with destinations that they can reach. Vehicles that
    arrive do so at lanes without predecessors, at the flow of the density at the desired speed, with headways of a
    shifted exponential distribution (a Poisson process whose vehicles keep a distance; Cowan 1975, M1 to M2).

    Args:
        road_map, graph, options, rng: The map, its lanes, the parameters, and where the numbers are drawn from.
        flow_for: Time in which vehicles arrive [s]; the ego does after ``WARM_UP``.
    """
    lanes, cost = graph.lanes, graph.routes.cost
    # No vehicles start in junctions, tapers and on very short lanes.
    is_open = (lanes.junction == NO_JUNCTION) & (lanes.conflicts_begin == lanes.conflicts_end)
    is_open &= (lanes.length > 3.0 * END_ROOM) & np.isfinite(cost).any(axis=0)
    density = options.density / 100.0 * np.where(np.isfinite(cost[0]), 1.0, options.oncoming)
    expected = density * lanes.length * is_open
    count = 1 + int(expected.sum() + rng.random())
    entering, times = np.empty(0, np.int64), np.empty(0)
    if flow_for:
        is_entry = is_open & ~np.isin(np.arange(len(lanes)), graph.successors)
        entering, times = arrival_times(_PACE * density * lanes.speed * is_entry, flow_for, rng)
    shares = np.append(_SHARES, [_MOTORCYCLES, options.cyclists]) if flow_for else _SHARES
    kind = rng.choice(len(shares), size=count + len(entering), p=shares / shares.sum())
    kind[0] = 0  # the ego is a car
    low, high = _RANGES[kind, :3].transpose(2, 0, 1)
    size = low + rng.random((len(kind), 1)) * (high - low)
    kept, lane, s = _place(road_map, graph, expected, size[:count, 0], rng)
    kept += range(count, len(kind))
    lane, s = [*lane, *entering.tolist()], [*s, *(size[count:, 0] / 2.0 + _AT_THE_END).tolist()]
    kind, size, count = kind[kept], size[kept], len(kept)
    arrivals = np.append(np.zeros(count - len(times), np.int64), 1 + (times / options.dt).astype(np.int64))
    if flow_for:
        arrivals[0] = round(WARM_UP / options.dt)

    vehicles: RecordArray = np.recarray(count, VEHICLE)
    vehicles.length, vehicles.width = size[:, 0], size[:, 1]
    vehicles.accel = rng.uniform(*_RANGES[kind, 3].T)
    vehicles.eagerness = rng.uniform(0.85, 1.1, count)
    vehicles.headway = rng.uniform(1.0, 1.8, count)
    vehicles.decel = rng.uniform(1.6, 2.6, count)
    vehicles.standstill = rng.uniform(1.8, 2.8, count)
    vehicles.politeness = rng.uniform(0.1, 0.5, count)
    vehicles.top_speed, vehicles.aside = np.inf, 0.0
    vehicles.active, vehicles.lane, vehicles.s = not flow_for, lane, s
    vehicles.destination = 0
    for i in range(1, 0 if flow_for else count):
        vehicles.destination[i] = rng.choice(np.flatnonzero(np.isfinite(cost[:, lane[i]])))
    if flow_for:
        drawn = np.where(np.isfinite(cost[:, lane]), rng.random((len(cost), count)), -1.0)
        vehicles.destination[1:] = drawn.argmax(axis=0)[1:]
    vehicles.speed = lanes.speed[lane] * vehicles.eagerness * rng.uniform(0.5, 1.0, count)
    vehicles.previous = vehicles.granted = vehicles.origin = NONE
    vehicles.lateral, vehicles.progress, vehicles.span = 0.0, 0.0, 1.0
    vehicles.waited, vehicles.wish = 0.0, NONE
    vehicles.patience = rng.uniform(0.0, 4.0, count)
    if flow_for:
        rides = kind == CYCLIST
        vehicles.top_speed[rides] = rng.uniform(*_CYCLING, int(rides.sum()))
        vehicles.speed = np.minimum(vehicles.speed, vehicles.top_speed)
        vehicles.aside[rides] = _FROM_THE_EDGE - graph.lane_width / 2.0
        vehicles.patience[rides] = np.inf  # they change lanes only where they have to
    return Population(_KINDS[kind].tolist(), size, vehicles, arrivals)


def arrival_times(rates: Float64, duration: float, rng: np.random.Generator) -> tuple[Int64, Float64]:
    """Lanes (K,) and times (K,) [s] of arrivals in a time [s], in order, for rates (L,) [1/s]."""
    entering, times = [np.empty(0, np.int64)], [np.empty(0)]
    for lane in np.flatnonzero(rates * duration > 1e-6).tolist():
        free = max(1.0 / rates[lane], 2.0 * _LEAST_HEADWAY) - _LEAST_HEADWAY
        headways = _LEAST_HEADWAY + rng.exponential(free, int(duration / _LEAST_HEADWAY))
        times.append(np.cumsum(headways) - rng.uniform(0.0, _LEAST_HEADWAY))
        times[-1] = times[-1][times[-1] < duration]
        entering.append(np.full(len(times[-1]), lane))
    order = np.argsort(np.concatenate(times), kind="stable")
    return np.concatenate(entering)[order], np.concatenate(times)[order]


def _place(
    road_map: RoadMap, graph: LaneGraph, expected: Float64, lengths: Float64, rng: np.random.Generator
) -> tuple[list[int], list[int], list[float]]:
    """Vehicles for which there is room, in order, and the lane and distance along it of each."""
    lanes, cumulative = graph.lanes, np.cumsum(expected)
    start = road_map.start[int(rng.integers(len(road_map.start)))]
    for row, own in enumerate(road_map.lanes):
        if own.id == start:
            chosen = [row]
    kept, along = [0], [float(rng.uniform(END_ROOM, 12.0))]
    for vehicle, length in enumerate(lengths[1:].tolist(), 1):
        for u, v in rng.random((_TRIES, 2)).tolist():
            lane = int(np.searchsorted(cumulative, u * cumulative[-1], side="right"))
            s = float(END_ROOM + v * (lanes.length[lane] - 2.0 * END_ROOM))
            if lanes.closed_from[lane] - 40.0 < s < lanes.closed_until[lane] + length:
                continue
            for other, beside, behind in zip(kept, chosen, along, strict=True):
                if lane == beside and abs(s - behind) <= ROOM + (length + lengths[other]) / 2.0:
                    break
            else:
                kept.append(vehicle)
                chosen.append(lane)
                along.append(s)
                break
    return kept, chosen, along


def place_construction(
    road_map: RoadMap, graph: LaneGraph, probability: float, rng: np.random.Generator
) -> tuple[LaneGraph, list[Obstacle]]:
    """Decide at random whether there are road works, and place them on an outermost lane of the ego's route.

    A lane is closed where traffic can avoid it; otherwise the works are on the shoulder. The ego's first lane leaves no
    room to change lanes before the works.

    Returns:
        The graph, with the closed lane if any, and the obstacles.
    """
    if rng.random() >= probability:
        return graph, []
    lanes, cost = graph.lanes, graph.routes.cost[0]
    is_candidate = (lanes.junction == NO_JUNCTION) & (lanes.right == NONE) & np.isfinite(cost)
    is_candidate &= (lanes.length > TAPER + WORKS + 3.0) & (lanes.conflicts_begin == lanes.conflicts_end)
    crowded = set[str]()
    for block in road_map.blocks:
        if block.obstacles:
            crowded.update(lane.id for lane in block.lanes)
    candidates, closable = [], []
    for row, lane in enumerate(road_map.lanes):
        if not is_candidate[row] or lane.id in road_map.start or lane.id in crowded:
            continue
        candidates.append(row)
        after = graph.successors[lanes.successors_begin[row] : lanes.successors_end[row]]
        if (
            lanes.left[row] != NONE
            and lanes.length[row] >= APPROACH + TAPER + WORKS
            and (lanes.junction[after] == NO_JUNCTION).all()
            and abs(cost[row] - cost[lanes.left[row]]) < LANE_CHANGE_COST / 2.0
        ):
            closable.append(row)
    if not candidates:
        return graph, []
    row = int(rng.choice(closable or candidates))
    is_breakdown, latest = bool(rng.random() < 0.4), lanes.length[row] - TAPER - WORKS
    width = road_map.road.lane_width
    if closable:
        begin = float(rng.uniform(APPROACH, latest))
        graph = close_lane(graph, row, begin - 2.0, begin + TAPER + WORKS)
        # A taper of cones across the lane, followed by barriers and cones, or a car, in the closed part.
        shares, edge = np.linspace(0.0, 1.0, _CONES), 0.5 * width - 0.45
        s = np.append(begin + shares * TAPER, begin + TAPER + shares[1:] * WORKS)
        left = np.append((2.0 * shares - 1.0) * edge, np.full(_CONES - 1, edge))
        things = [_CONE] * len(s) + [_BARRIER] * 2 + [_BROKEN_CAR] * is_breakdown
        s = np.append(s, [begin + TAPER + 0.5, begin + TAPER + 0.5, begin + TAPER + WORKS - 4.0])
        left = np.append(left, [-0.85, 0.85, 0.0])
    else:
        begin, beyond = float(rng.uniform(0.5, 1.0)) * latest, -0.5 * width
        # Cones along the edge, and a barrier or a car beyond it.
        things = [_CONE] * _CONES + [_BROKEN_CAR if is_breakdown else _BARRIER]
        s = np.append(begin + np.arange(_CONES) * (TAPER + WORKS) / _CONES, begin + TAPER)
        left = np.append(np.full(_CONES, beyond - 0.25), beyond - (1.5 if is_breakdown else 1.3))
    obstacles = []
    for (kind, word, size, turn), ahead, aside in zip(things, s.tolist(), left.tolist(), strict=False):
        pose = road_map.lanes[row].path.pose_at(ahead).moved(0.0, aside, turn)
        room = np.hypot(graph.points.x - pose.x, graph.points.y - pose.y).min() - graph.lane_width / 2.0
        # Beside the road they may not block a lane, for example a ramp; only a car is parallel to the lane.
        if closable or room > size[kind == ObjectType.VEHICLE] / 2.0:
            obstacles.append(Obstacle(kind, word, pose.x, pose.y, pose.heading, size))
    return graph, obstacles


def boxes(obstacles: list[Obstacle]) -> tuple[Float64, Float64]:
    """Return (N, 3) x, y, heading and (N, 3) sizes of obstacles."""
    table = np.array([(o.x, o.y, o.heading, *o.size) for o in obstacles], np.float64).reshape(-1, 6)
    return table[:, :3], table[:, 3:]
