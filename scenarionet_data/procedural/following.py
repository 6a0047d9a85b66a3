"""Longitudinal control: the largest acceleration that obstacles ahead on a vehicle's route allow."""

from __future__ import annotations

import numpy as np

from scenarionet_data.arrays.dtypes import ArrayRecord, RecordArray
from scenarionet_data.arrays.idm import free_acceleration, interaction
from scenarionet_data.compiled.decorators import device_function
from scenarionet_data.procedural.graph import CROSS, MERGE, NONE, SPLIT, LaneGraph
from scenarionet_data.procedural.vehicles import PLACES, desired_speed

HORIZON = 30.0, 5.0  # [m], [s] look-ahead distance: constant part, and the time whose driving distance is added
ROOM_TO_CHANGE = 16.0  # [m] kept free ahead by vehicles that have to change lanes before driving on
HARDEST_BRAKING = 8.0  # [m/s2]
COURTESY = 2.0  # [s] after which one that waits to change lanes is let in
_FIRM_BRAKING = 3.5  # [m/s2] that the model may ask for also where less would do
_RESERVE = 1.3  # by which a driver brakes harder than constant braking up to the leader would be
_LEAST_GAP = 0.5  # [m] left after such braking
_MANY_HOPS = 30


@device_function
def acceleration(graph: LaneGraph, vehicles: RecordArray, places: RecordArray, i: int) -> float:
    """Acceleration of vehicle ``i`` in this timestep [m/s2]."""
    vehicle, leaving = vehicles[i], places[i, 1]
    braking = braking_along(graph, vehicles, places, i, vehicle.lane, vehicle.s, True)
    if vehicle.origin != NONE and leaving.lane != NONE:
        gap, speed = nearest_on(graph, vehicles, places, i, leaving.lane, -leaving.s)
        braking = max(braking, _braking(graph.flows, vehicle, gap, speed))
    desired = desired_speed(graph, vehicle, vehicle.lane)
    wanted = free_acceleration(vehicle.speed, desired, vehicle.accel, vehicle.decel) - braking
    return float(max(wanted, -HARDEST_BRAKING))


@device_function
def braking_along(
    graph: LaneGraph, vehicles: RecordArray, places: RecordArray, i: int, lane: int, s: float, stops: bool
) -> float:
    """The strongest braking [m/s2, >= 0] that anything ahead requires of vehicle ``i`` at ``s`` on ``lane``.

    Args:
        graph, vehicles, places: See ``drive``.
        i: The vehicle.
        lane: Lane it drives on, or would drive on after a lane change.
        s: Distance along that lane [m].
        stops: Whether to heed closed lanes, missing grants and bends too, not only vehicles.
    """
    vehicle, braking, before = vehicles[i], 0.0, -s
    horizon = HORIZON[0] + HORIZON[1] * vehicle.speed
    for _ in range(_MANY_HOPS):
        gap, speed = nearest_on(graph, vehicles, places, i, lane, before)
        braking = max(braking, _braking(graph.flows, vehicle, gap, speed))
        end = before + graph.lanes[lane].length
        following = graph.routes[vehicle.destination, lane].next_lane
        if stops:
            if graph.flows:
                braking = max(
                    braking,
                    _braking(graph.flows, vehicle, _gap_to_crossing(graph, vehicles, places, i, lane, before), 0.0),
                )
            stop = np.inf  # where to stop: before road works, a junction without a grant, the end of the route
            if before + graph.lanes[lane].closed_until > 0.0:
                stop = before + graph.lanes[lane].closed_from - ROOM_TO_CHANGE
            if following == NONE:
                stop = min(stop, end - room_needed(graph, vehicle, lane))
            elif graph.lanes[following].needs_grant and vehicle.granted != following:
                stop = min(stop, end)
            braking = max(braking, _braking(graph.flows, vehicle, stop - vehicle.length / 2.0, 0.0))
        if following == NONE or end > horizon:
            break
        slow = desired_speed(graph, vehicle, following)
        if stops and vehicle.speed > slow:  # brake for the bend ahead, as late as is comfortable
            needed = (vehicle.speed**2 - slow**2) / (2.0 * max(end, 1.0))
            if needed > 0.7 * vehicle.decel:
                if graph.flows:  # so that the deceleration is what is needed
                    desired = desired_speed(graph, vehicle, lane)
                    needed += free_acceleration(vehicle.speed, desired, vehicle.accel, vehicle.decel)
                braking = max(braking, needed)
        lane, before = following, end
    return braking


@device_function
def nearest_on(
    graph: LaneGraph, vehicles: RecordArray, places: RecordArray, i: int, lane: int, before: float
) -> tuple[float, float]:
    """Gap to, and speed of, the nearest vehicle ahead of ``i`` on a lane that starts ``before`` ahead of it.

    Vehicles on lanes that split from this one or merge into it count while the lanes still overlap.
    """
    gap, speed = np.inf, 0.0
    own_lane, own_length = graph.lanes[lane], vehicles[i].length
    for j in range(len(vehicles)):
        other = vehicles[j]
        if j == i or not other.active:
            continue
        half = other.length / 2.0
        for place in range(PLACES):
            where, s = places[j, place].lane, places[j, place].s
            if where == NONE:
                continue
            ahead = -np.inf
            if where == lane:
                ahead = before + s
            else:
                for row in range(own_lane.conflicts_begin, own_lane.conflicts_end):
                    conflict = graph.conflicts[row]
                    if conflict.lane != where or conflict.kind == CROSS:
                        continue
                    if conflict.kind == SPLIT and s - half < conflict.other_end:
                        ahead = before + s
                        break
                    if conflict.kind != SPLIT and s + half > conflict.other_begin:
                        ahead = before + own_lane.length - (graph.lanes[where].length - s)
                        if graph.flows and ahead > 0.0:  # they do not touch before the place where the lanes meet
                            if own_lane.needs_grant and before > 0.0 and vehicles[i].granted != lane:
                                ahead = -np.inf
                            else:
                                ahead = max(ahead, before + conflict.own_begin + half)
                        break
            clear = ahead - (own_length + other.length) / 2.0
            if (ahead > 0.0 or (ahead == 0.0 and j < i)) and clear < gap:
                gap, speed = clear, other.speed
        if graph.flows and (other.wish == lane or other.granted != NONE):
            ahead = _yielding(graph, vehicles[i], other, lane, before) - (own_length + other.length) / 2.0
            if 0.0 < ahead < gap:
                gap, speed = ahead, other.speed
    return gap, speed


@device_function
def _gap_to_crossing(
    graph: LaneGraph, vehicles: RecordArray, places: RecordArray, i: int, lane: int, before: float
) -> float:
    """Gap [m] to the first place ahead on a lane where another vehicle is crossing it; infinite where nobody is."""
    nearest = np.inf
    for row in range(graph.lanes[lane].conflicts_begin, graph.lanes[lane].conflicts_end):
        conflict = graph.conflicts[row]
        gap = before + conflict.own_begin - vehicles[i].length / 2.0
        if conflict.kind != CROSS or gap < 0.0 or gap > nearest:
            continue
        for j in range(len(vehicles)):
            half = vehicles[j].length / 2.0
            for place in range(PLACES):
                s = places[j, place].s
                is_there = vehicles[j].active and j != i and places[j, place].lane == conflict.lane
                if is_there and s + half > conflict.other_begin and s - half < conflict.other_end:
                    nearest = gap
    return nearest


@device_function
def _yielding(graph: LaneGraph, vehicle: ArrayRecord, other: ArrayRecord, lane: int, before: float) -> float:
    """Distance ahead [m] of one that is let in to ``lane``: from beside, or with a grant where a lane joins; or 0."""
    if other.wish == lane:
        own, beside = graph.lanes[lane], graph.lanes[other.lane]
        ahead = before + other.s * own.length / beside.length
        can_stop = ahead - vehicle.length > vehicle.speed**2 / (2.0 * vehicle.decel) + other.length / 2.0
        return ahead if other.waited > COURTESY and can_stop else 0.0
    for row in range(graph.lanes[lane].conflicts_begin, graph.lanes[lane].conflicts_end):
        conflict = graph.conflicts[row]
        if conflict.kind == MERGE and conflict.lane == other.granted:
            if graph.routes[other.destination, other.lane].next_lane != conflict.lane:
                return 0.0
            if graph.lanes[lane].needs_grant and before > 0.0 and vehicle.granted != lane:
                return 0.0
            way = graph.lanes[other.lane].length - other.s + graph.lanes[conflict.lane].length
            ahead = before + graph.lanes[lane].length - way
            return float(max(ahead, before + conflict.own_begin + other.length / 2.0)) if ahead > 0.0 else 0.0
    return 0.0


@device_function
def room_needed(graph: LaneGraph, vehicle: ArrayRecord, lane: int) -> float:
    """Distance before the end of ``lane`` at which a vehicle has to leave it [m]: room for each lane change needed."""
    if graph.lanes[lane].is_last:
        return -np.inf
    changes, left, right = 0, lane, lane
    while left != NONE or right != NONE:
        for beside in (left, right):
            if beside != NONE and graph.routes[vehicle.destination, beside].next_lane != NONE:
                return changes * ROOM_TO_CHANGE
        changes += 1
        left = graph.lanes[left].left if left != NONE else NONE
        right = graph.lanes[right].right if right != NONE else NONE
    return ROOM_TO_CHANGE


@device_function
def _braking(is_firm: bool, vehicle: ArrayRecord, gap: float, speed: float) -> float:
    """Braking for a leader at ``speed`` after a ``gap``; if it is firm, no harder than it has to be."""
    if gap == np.inf:
        return 0.0
    needed = max(vehicle.speed**2 - speed**2, 0.0) / (2.0 * max(gap - _LEAST_GAP, _LEAST_GAP))
    most = vehicle.accel + max(_FIRM_BRAKING, _RESERVE * needed) if is_firm else np.inf
    wanted = interaction(
        vehicle.speed,
        gap,
        vehicle.speed - speed,
        vehicle.headway,
        vehicle.accel,
        vehicle.decel,
        vehicle.standstill,
    )
    return float(min(wanted, most))
