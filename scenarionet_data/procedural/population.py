"""Vehicles of a scenario: their kinds, start positions and destinations."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from scenarionet_data.arrays.dtypes import Float64, Int64, RecordArray
from scenarionet_data.procedural.graph import NONE, LaneGraph
from scenarionet_data.procedural.options import GeneratorOptions
from scenarionet_data.procedural.roadmap import NO_JUNCTION, RoadMap
from scenarionet_data.procedural.vehicles import VEHICLE


@dataclass(frozen=True)
class VehicleKind:
    """A kind of vehicle: share of traffic; ranges of length, width and height [m] and of acceleration [m/s2]."""

    name: str
    share: float
    length: tuple[float, float]
    width: tuple[float, float]
    height: tuple[float, float]
    accel: tuple[float, float]


KINDS = (
    VehicleKind("car", 0.74, (4.1, 5.0), (1.75, 1.95), (1.4, 1.65), (1.4, 2.2)),
    VehicleKind("van", 0.14, (4.9, 5.8), (1.95, 2.05), (1.9, 2.4), (1.1, 1.6)),
    VehicleKind("truck", 0.08, (6.5, 8.5), (2.2, 2.4), (2.7, 3.4), (0.8, 1.1)),
    VehicleKind("bus", 0.04, (9.0, 10.5), (2.4, 2.5), (3.0, 3.2), (0.9, 1.2)),
)
ROOM = 3.0  # [m] bumper to bumper between vehicles at the start, at least
END_ROOM = 6.0  # [m] free of vehicles' centres at both ends of a lane, at the start
_TRIES = 20


@dataclass(frozen=True, eq=False)
class Population:
    """Vehicles of a scenario, the ego first.

    Attributes:
        kinds: Names of their kinds.
        size: (N, 3) length, width, height [m].
        vehicles: (N,) ``VEHICLE`` records.
    """

    kinds: list[str]
    size: Float64
    vehicles: RecordArray


def populate(road_map: RoadMap, graph: LaneGraph, options: GeneratorOptions, rng: np.random.Generator) -> Population:
    """Draw the vehicles: the ego on the first road, the others on all roads by density."""
    share = _lane_shares(road_map, graph, options)
    wanted = 1 + int(share.sum() + rng.random())
    kinds, size = _draw_vehicles(wanted, rng)
    places = _place(road_map, graph, share, size[:, 0], rng)
    kept = [row for row, place in enumerate(places) if place is not None]
    lane = np.array([place[0] for place in places if place is not None], dtype=np.int64)
    s = np.array([place[1] for place in places if place is not None])
    vehicles: RecordArray = np.recarray(len(kept), VEHICLE)
    _draw_drivers(vehicles, [kinds[row] for row in kept], size[kept], rng)
    _draw_start(vehicles, graph, lane, s, rng)
    return Population([kinds[row].name for row in kept], size[kept], vehicles)


def _lane_shares(road_map: RoadMap, graph: LaneGraph, options: GeneratorOptions) -> Float64:
    """(L,) expected number of vehicles on each lane; none in junctions, tapers and on very short lanes."""
    is_open = np.array([lane.junction == NO_JUNCTION for lane in road_map.lanes])
    is_open &= graph.lanes.conflicts_begin == graph.lanes.conflicts_end
    is_open &= graph.lanes.length > 3.0 * END_ROOM
    is_open &= np.isfinite(graph.routes.cost).any(axis=0)
    with_ego = np.isfinite(graph.routes.cost[0])
    density = options.density / 100.0 * np.where(with_ego, 1.0, options.oncoming)
    shares: Float64 = density * graph.lanes.length * is_open
    return shares


def _draw_vehicles(count: int, rng: np.random.Generator) -> tuple[list[VehicleKind], Float64]:
    shares = np.array([kind.share for kind in KINDS])
    drawn = rng.choice(len(KINDS), size=count, p=shares / shares.sum())
    drawn[0] = 0  # the ego is a car
    kinds = [KINDS[k] for k in drawn]
    low, high = (np.array([[kind.length[end], kind.width[end], kind.height[end]] for kind in kinds]) for end in (0, 1))
    return kinds, low + rng.random((count, 1)) * (high - low)


def _place(
    road_map: RoadMap, graph: LaneGraph, share: Float64, length: Float64, rng: np.random.Generator
) -> list[tuple[int, float] | None]:
    """Lane and distance along it for each vehicle, or None where there was no room."""
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
            s = float(END_ROOM + v * (graph.lanes.length[lane] - 2.0 * END_ROOM))
            if _has_room(graph, taken.get(lane, []), lane, s, own):
                place = (lane, s)
                taken.setdefault(lane, []).append((s, float(own)))
                break
        places.append(place)
    return places


def _has_room(graph: LaneGraph, taken: list[tuple[float, float]], lane: int, s: float, length: float) -> bool:
    begin, end = graph.lanes.closed_from[lane], graph.lanes.closed_until[lane]
    if begin - 40.0 < s < end + length:
        return False
    return all(abs(s - other) > ROOM + (length + other_length) / 2.0 for other, other_length in taken)


def _draw_drivers(vehicles: RecordArray, kinds: list[VehicleKind], size: Float64, rng: np.random.Generator) -> None:
    """Set the constant parameters of vehicles and drivers."""
    count = len(kinds)
    vehicles.length, vehicles.width = size[:, 0], size[:, 1]
    vehicles.accel = [rng.uniform(*kind.accel) for kind in kinds]
    vehicles.eagerness = rng.uniform(0.85, 1.1, count)
    vehicles.headway = rng.uniform(1.0, 1.8, count)
    vehicles.decel = rng.uniform(1.6, 2.6, count)
    vehicles.standstill = rng.uniform(1.8, 2.8, count)
    vehicles.politeness = rng.uniform(0.1, 0.5, count)


def _draw_start(vehicles: RecordArray, graph: LaneGraph, lane: Int64, s: Float64, rng: np.random.Generator) -> None:
    """Set the state at time 0, with reachable destinations; ``drive`` lowers speeds where necessary."""
    count = len(lane)
    vehicles.active, vehicles.lane, vehicles.s = True, lane, s
    vehicles.destination = 0
    for i in range(1, count):
        (reachable,) = np.nonzero(np.isfinite(graph.routes.cost[:, lane[i]]))
        vehicles.destination[i] = rng.choice(reachable)
    vehicles.speed = graph.lanes.speed[lane] * vehicles.eagerness * rng.uniform(0.5, 1.0, count)
    vehicles.previous = vehicles.granted = vehicles.origin = NONE
    vehicles.lateral, vehicles.progress, vehicles.span = 0.0, 0.0, 1.0
    vehicles.patience = rng.uniform(0.0, 4.0, count)
