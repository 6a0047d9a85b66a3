"""Lane changes: to follow the route, to pass road works, or for advantage (MOBIL)."""

from __future__ import annotations

import numpy as np

from scenarionet_data.arrays.dtypes import ArrayRecord, RecordArray
from scenarionet_data.arrays.idm import free_acceleration, interaction, is_worth_changing
from scenarionet_data.compiled.decorators import device_function
from scenarionet_data.procedural.following import braking_along, nearest_on, room_needed
from scenarionet_data.procedural.graph import LANE_CHANGE_COST, NONE, LaneGraph
from scenarionet_data.procedural.vehicles import PLACES, abreast, desired_speed

SHORTEST = 12.0  # [m] least length of a lane change
DURATION = 3.2  # [s] usual duration of a lane change
SAFE_BRAKING = 3.0  # [m/s2] hardest braking that a lane change may impose
THRESHOLD = 0.3  # [m/s2] advantage from which a lane change is worthwhile
PATIENCE = 4.0  # [s] between lane changes for advantage
_CLOSED_AHEAD = 120.0  # [m] at which road works are seen
STOPPING_ROOM = 6.0  # [m] that drivers keep between their centre and where they have to stop
_FORESIGHT = 2.0  # [s] for which the vehicle ahead is expected to drive on
_GAP = 2.0  # [m] least gap, bumper to bumper
_HOPS = 3


@device_function
def consider(graph: LaneGraph, vehicles: RecordArray, places: RecordArray, i: int) -> None:
    """Start a lane change of vehicle ``i`` if it must or should, and can."""
    vehicle = vehicles[i]
    if vehicle.lateral != 0.0:
        return
    lane = vehicle.lane
    own = graph.lanes[lane]
    vehicle.wish = NONE
    for side in (1.0, -1.0):
        target = own.left if side > 0.0 else own.right
        if target == NONE:
            continue
        beside = graph.lanes[target]
        s = abreast(graph, lane, vehicle.s, target)
        works = own.closed_from - vehicle.s
        own_cost = graph.routes[vehicle.destination, lane].cost
        cost = graph.routes[vehicle.destination, target].cost
        must = cost + LANE_CHANGE_COST / 2.0 < own_cost  # the route leads over the target
        if -SHORTEST < works < _CLOSED_AHEAD and np.isinf(beside.closed_from):
            must = True
        if not must and (vehicle.patience > 0.0 or cost > own_cost + LANE_CHANGE_COST / 2.0):
            continue
        if must:
            vehicle.wish = target
        span = _span(graph, vehicle, target, s, side)
        if span == 0.0 or beside.closed_from - 60.0 < s < beside.closed_until + 8.0:
            continue
        if not _is_way_clear(graph, vehicles, places, i, target, s, span):
            continue
        if is_accepted(graph, vehicles, places, i, target, s, must):
            vehicle.origin, vehicle.previous, vehicle.granted = lane, NONE, NONE
            vehicle.lane, vehicle.s = target, s
            vehicle.lateral, vehicle.progress, vehicle.span = -side * graph.lane_width, 0.0, span
            vehicle.patience, vehicle.wish = PATIENCE, NONE
            return


@device_function
def _span(graph: LaneGraph, vehicle: ArrayRecord, target: int, s: float, side: float) -> float:
    """Distance over which a vehicle would change lanes [m]; 0 when there is not enough."""
    span = max(SHORTEST, DURATION * vehicle.speed)
    shortest = max(SHORTEST, 0.55 * span)
    room = graph.lanes[target].length - s - STOPPING_ROOM - max(0.0, room_needed(graph, vehicle, target))
    following = graph.routes[vehicle.destination, target].next_lane
    if following != NONE:
        behind = graph.lanes[following].right if side > 0.0 else graph.lanes[following].left
        if behind != NONE:
            room = np.inf
    works = graph.lanes[vehicle.lane].closed_from - vehicle.s
    if works > 0.0:
        room = min(room, works - 2.0)
    return 0.0 if room < shortest else float(min(span, room))


@device_function
def _is_way_clear(
    graph: LaneGraph, vehicles: RecordArray, places: RecordArray, i: int, target: int, s: float, span: float
) -> bool:
    """Whether both lanes are free far enough ahead to complete the change within ``span``."""
    gap, speed = nearest_on(graph, vehicles, places, i, target, -s)
    if gap + _FORESIGHT * speed < span:
        return False
    gap, speed = nearest_on(graph, vehicles, places, i, vehicles[i].lane, -vehicles[i].s)
    return bool(gap + _FORESIGHT * speed > 0.5 * span)


@device_function
def is_accepted(
    graph: LaneGraph, vehicles: RecordArray, places: RecordArray, i: int, target: int, s: float, must: bool
) -> bool:
    """Whether the gap in ``target`` is safe and, for an optional change, worth it."""
    vehicle = vehicles[i]
    if graph.flows and nearest_on(graph, vehicles, places, i, target, -s)[0] < _GAP:
        return False
    braking = braking_along(graph, vehicles, places, i, target, s, False)
    desired = desired_speed(graph, vehicle, target)
    after = free_acceleration(vehicle.speed, desired, vehicle.accel, vehicle.decel) - braking
    if after < -SAFE_BRAKING:
        return False
    loss = 0.0
    for j in range(len(vehicles)):
        other = vehicles[j]
        if j == i or not other.active:
            continue
        gap = _gap_behind(graph, vehicles, places, i, j, target, s)
        if gap == np.inf:
            continue
        closing = other.speed - vehicle.speed
        yielding = interaction(other.speed, gap, closing, other.headway, other.accel, other.decel, other.standstill)
        if gap < _GAP + 0.3 * max(closing, 0.0) or yielding > SAFE_BRAKING + other.accel:
            return False
        loss = max(loss, yielding)
    if must:
        return True
    now = braking_along(graph, vehicles, places, i, vehicle.lane, vehicle.s, False)
    return is_worth_changing(now - braking, loss, vehicle.politeness, THRESHOLD)


@device_function
def _gap_behind(
    graph: LaneGraph, vehicles: RecordArray, places: RecordArray, i: int, j: int, target: int, s: float
) -> float:
    """Gap from vehicle ``j`` to ``i`` at ``s`` on ``target`` if ``j`` is behind or alongside, else infinite."""
    halves = (vehicles[i].length + vehicles[j].length) / 2.0
    for place in range(PLACES):
        if places[j, place].lane == target and abs(places[j, place].s - s) < halves:
            return 0.0
    for place in range(2):
        where, ahead = places[j, place].lane, -places[j, place].s
        for _ in range(_HOPS):
            if where == NONE:
                break
            if where == target:
                if ahead + s > 0.0:
                    return float(ahead + s - halves)
                break
            ahead += graph.lanes[where].length
            where = graph.routes[vehicles[j].destination, where].next_lane
    return np.inf
