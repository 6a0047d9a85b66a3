"""The vehicles of a scenario: what they are, where they start, and where they go."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from scenarionet_data.arrays.dtypes import Float64
from scenarionet_data.procedural.graph import NONE, LaneGraph
from scenarionet_data.procedural.options import GeneratorOptions
from scenarionet_data.procedural.roadmap import NO_JUNCTION, RoadMap
from scenarionet_data.procedural.vehicles import Fleet, State


@dataclass(frozen=True)
class Kind:
    """A kind of vehicle: its share of traffic, ranges of length, width, height [m], and its vigour."""

    name: str
    share: float
    length: tuple[float, float]
    width: tuple[float, float]
    height: tuple[float, float]
    accel: tuple[float, float]


KINDS = (
    Kind("car", 0.74, (4.1, 5.0), (1.75, 1.95), (1.4, 1.65), (1.4, 2.2)),
    Kind("van", 0.14, (4.9, 5.8), (1.95, 2.05), (1.9, 2.4), (1.1, 1.6)),
    Kind("truck", 0.08, (6.5, 8.5), (2.2, 2.4), (2.7, 3.4), (0.8, 1.1)),
    Kind("bus", 0.04, (9.0, 10.5), (2.4, 2.5), (3.0, 3.2), (0.9, 1.2)),
)
ROOM = 3.0  # [m] bumper to bumper between vehicles at the start, at least
END_ROOM = 6.0  # [m] free of vehicles' centres at both ends of a lane, at the start
_TRIES = 20


@dataclass(frozen=True, eq=False)
class Population:
    """Vehicles of a scenario, the ego first: kind, (N, 3) length, width, height [m], driver and start."""

    kinds: list[str]
    size: Float64
    fleet: Fleet
    state: State


def populate(road_map: RoadMap, graph: LaneGraph, options: GeneratorOptions, rng: np.random.Generator) -> Population:
    """Draw the vehicles: the ego on the first road, the others by density on all roads."""
    share = _lane_shares(road_map, graph, options)
    wanted = 1 + int(share.sum() + rng.random())
    kinds, size = _draw_vehicles(wanted, rng)
    places = _place(road_map, graph, share, size[:, 0], rng)
    kept = [row for row, place in enumerate(places) if place is not None]
    lane = np.array([place[0] for place in places if place is not None], dtype=np.int32)
    s = np.array([place[1] for place in places if place is not None])
    fleet = _draw_drivers([kinds[row] for row in kept], size[kept], rng)
    state = _start(graph, fleet, lane, s, rng)
    return Population([kinds[row].name for row in kept], size[kept], fleet, state)


def _lane_shares(road_map: RoadMap, graph: LaneGraph, options: GeneratorOptions) -> Float64:
    """(L,) expected number of vehicles on each lane; none in junctions, tapers and on very short lanes."""
    is_open = np.array([lane.junction == NO_JUNCTION for lane in road_map.lanes])
    is_open &= (np.diff(graph.conflict_first) == 0) & (graph.length > 3.0 * END_ROOM)
    with_ego = np.isfinite(graph.cost[0])
    density = options.density / 100.0 * np.where(with_ego, 1.0, options.oncoming)
    shares: Float64 = density * graph.length * is_open
    return shares


def _draw_vehicles(count: int, rng: np.random.Generator) -> tuple[list[Kind], Float64]:
    shares = np.array([kind.share for kind in KINDS])
    drawn = rng.choice(len(KINDS), size=count, p=shares / shares.sum())
    drawn[0] = 0  # the ego is a car
    kinds = [KINDS[k] for k in drawn]
    low, high = (np.array([[kind.length[end], kind.width[end], kind.height[end]] for kind in kinds]) for end in (0, 1))
    return kinds, low + rng.random((count, 1)) * (high - low)


def _place(
    road_map: RoadMap, graph: LaneGraph, share: Float64, length: Float64, rng: np.random.Generator
) -> list[tuple[int, float] | None]:
    """A lane and distance along it for each vehicle, or None where no room was found."""
    number = {lane.id: row for row, lane in enumerate(road_map.lanes)}
    start = number[road_map.start[int(rng.integers(len(road_map.start)))]]
    s = float(rng.uniform(END_ROOM, 12.0))
    places: list[tuple[int, float] | None] = [(start, s)]
    taken = {start: [(s, float(length[0]))]}
    cumulative = np.cumsum(share)
    for own in length[1:]:
        place = None
        for u, v in rng.random((_TRIES, 2)):
            lane = int(np.searchsorted(cumulative, u * cumulative[-1], side="right"))
            s = float(END_ROOM + v * (graph.length[lane] - 2.0 * END_ROOM))
            if _has_room(graph, taken.get(lane, []), lane, s, own):
                place = (lane, s)
                taken.setdefault(lane, []).append((s, float(own)))
                break
        places.append(place)
    return places


def _has_room(graph: LaneGraph, taken: list[tuple[float, float]], lane: int, s: float, length: float) -> bool:
    begin, end = graph.blocked[lane]
    if begin - 40.0 < s < end + length:
        return False
    return all(abs(s - other) > ROOM + (length + other_length) / 2.0 for other, other_length in taken)


def _draw_drivers(kinds: list[Kind], size: Float64, rng: np.random.Generator) -> Fleet:
    count = len(kinds)
    accel = np.array([rng.uniform(*kind.accel) for kind in kinds])
    return Fleet(
        length=size[:, 0].copy(),
        width=size[:, 1].copy(),
        eagerness=rng.uniform(0.85, 1.1, count),
        headway=rng.uniform(1.0, 1.8, count),
        accel=accel,
        decel=rng.uniform(1.6, 2.6, count),
        standstill=rng.uniform(1.8, 2.8, count),
        politeness=rng.uniform(0.1, 0.5, count),
    )


def _start(graph: LaneGraph, fleet: Fleet, lane: np.ndarray, s: Float64, rng: np.random.Generator) -> State:
    """The state at time 0, with destinations that can be reached; speeds are lowered later where they must."""
    count = len(lane)
    destination = np.zeros(count, dtype=np.int32)
    for i in range(1, count):
        (reachable,) = np.nonzero(np.isfinite(graph.cost[:, lane[i]]))
        destination[i] = rng.choice(reachable)
    none = np.full(count, NONE, dtype=np.int32)
    return State(
        active=np.ones(count, dtype=np.bool_),
        destination=destination,
        lane=lane,
        s=s,
        speed=graph.speed[lane] * fleet.eagerness * rng.uniform(0.5, 1.0, count),
        previous=none.copy(),
        granted=none.copy(),
        origin=none.copy(),
        lateral=np.zeros(count),
        progress=np.zeros(count),
        span=np.ones(count),
        patience=rng.uniform(0.0, 4.0, count),
    )
