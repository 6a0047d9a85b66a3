"""Longitudinal control: the acceleration that everything ahead on a vehicle's route allows."""

from __future__ import annotations

import numpy as np

from scenarionet_data.arrays.compiled import device_function
from scenarionet_data.procedural.conflicts import CROSS, SPLIT
from scenarionet_data.procedural.graph import NONE, LaneGraph
from scenarionet_data.procedural.idm import free_acceleration, interaction
from scenarionet_data.procedural.vehicles import PLACES, Fleet, Places, State

HORIZON = 30.0, 5.0  # [m], [s] drivers look ahead: the first, and the way in the second
ROOM_TO_CHANGE = 16.0  # [m] kept free ahead by who has to change lanes before going on
HARDEST_BRAKING = 8.0  # [m/s2]
_MANY_HOPS = 30


@device_function
def acceleration(graph: LaneGraph, fleet: Fleet, state: State, places: Places, i: int) -> float:
    """What vehicle ``i`` does now [m/s2]."""
    lane, s = state.lane[i], state.s[i]
    braking = braking_along(graph, fleet, state, places, i, lane, s, True)
    if state.origin[i] != NONE and places.lane[i, 1] != NONE:
        gap, speed = nearest_on(graph, fleet, state, places, i, places.lane[i, 1], -places.s[i, 1])
        braking = max(braking, _braking(fleet, state, i, gap, speed))
    desired = graph.speed[lane] * fleet.eagerness[i]
    wanted = free_acceleration(state.speed[i], desired, fleet.accel[i], fleet.decel[i]) - braking
    return float(max(wanted, -HARDEST_BRAKING))


@device_function
def braking_along(
    graph: LaneGraph, fleet: Fleet, state: State, places: Places, i: int, lane: int, s: float, stops: bool
) -> float:
    """The strongest braking that vehicle ``i`` at ``s`` on ``lane`` has to do for what is ahead [m/s2, >= 0].

    Args:
        stops: Whether to heed closed lanes, missing grants and bends too, not only vehicles.
    """
    braking, before = 0.0, -s
    horizon = HORIZON[0] + HORIZON[1] * state.speed[i]
    for _ in range(_MANY_HOPS):
        gap, speed = nearest_on(graph, fleet, state, places, i, lane, before)
        braking = max(braking, _braking(fleet, state, i, gap, speed))
        end = before + graph.length[lane]
        following = graph.next_lane[state.destination[i], lane]
        if stops:
            obstacle = _stop_on(graph, state, i, lane, before, following)
            braking = max(braking, _braking(fleet, state, i, obstacle - fleet.length[i] / 2.0, 0.0))
        if following == NONE or end > horizon:
            break
        if stops:
            braking = max(braking, _braking_for_bend(graph, fleet, state, i, following, end))
        lane, before = following, end
    return braking


@device_function
def nearest_on(
    graph: LaneGraph, fleet: Fleet, state: State, places: Places, i: int, lane: int, before: float
) -> tuple[float, float]:
    """Gap to, and speed of, the nearest vehicle ahead of ``i`` on a lane that starts ``before`` ahead of it.

    Vehicles on lanes that split from this one or merge into it count where the lanes are still together.
    """
    gap, speed = np.inf, 0.0
    is_apart = graph.conflict_first[lane] == graph.conflict_first[lane + 1]
    for j in range(len(state.lane)):
        if j == i or not state.active[j]:
            continue
        for place in range(PLACES):
            if places.lane[j, place] == NONE:
                continue
            if places.lane[j, place] == lane:
                ahead = before + places.s[j, place]
            elif is_apart:
                continue
            else:
                ahead = _distance_beside(graph, fleet, places, j, place, lane, before)
            clear = ahead - (fleet.length[i] + fleet.length[j]) / 2.0
            if (ahead > 0.0 or (ahead == 0.0 and j < i)) and clear < gap:
                gap, speed = clear, state.speed[j]
    return gap, speed


@device_function
def _distance_beside(
    graph: LaneGraph, fleet: Fleet, places: Places, j: int, place: int, lane: int, before: float
) -> float:
    """Distance to a place of vehicle ``j`` on a lane still or already joined with ``lane``, else minus infinity."""
    where, s, half = places.lane[j, place], places.s[j, place], fleet.length[j] / 2.0
    for row in range(graph.conflict_first[lane], graph.conflict_first[lane + 1]):
        other, kind = graph.conflicts[row, 0], graph.conflicts[row, 1]
        if other != where or kind == CROSS:
            continue
        if kind == SPLIT and s - half < graph.conflict_zones[row, 3]:
            return float(before + s)
        if kind != SPLIT and s + half > graph.conflict_zones[row, 2]:
            return float(before + graph.length[lane] - (graph.length[other] - s))
    return -np.inf


@device_function
def _stop_on(graph: LaneGraph, state: State, i: int, lane: int, before: float, following: int) -> float:
    """Distance to where vehicle ``i`` must stop on ``lane``: before road works, a closed junction, a wrong way."""
    end = before + graph.length[lane]
    stop = np.inf
    if before + graph.blocked[lane, 1] > 0.0:
        stop = before + graph.blocked[lane, 0] - ROOM_TO_CHANGE
    if following == NONE:
        stop = min(stop, end - room_needed(graph, state, i, lane))
    elif graph.needs_grant[following] and state.granted[i] != following:
        stop = min(stop, end)
    return stop


@device_function
def room_needed(graph: LaneGraph, state: State, i: int, lane: int) -> float:
    """How far before the end of ``lane`` vehicle ``i`` has to leave it [m]: room for each lane change it needs."""
    if graph.exit_first[lane] == graph.exit_first[lane + 1]:
        return -np.inf
    changes, left, right = 0, lane, lane
    while left != NONE or right != NONE:
        for beside in (left, right):
            if beside != NONE and graph.next_lane[state.destination[i], beside] != NONE:
                return changes * ROOM_TO_CHANGE
        changes += 1
        left = graph.left[left] if left != NONE else NONE
        right = graph.right[right] if right != NONE else NONE
    return ROOM_TO_CHANGE


@device_function
def _braking(fleet: Fleet, state: State, i: int, gap: float, speed: float) -> float:
    if gap == np.inf:
        return 0.0
    return interaction(
        state.speed[i],
        gap,
        state.speed[i] - speed,
        fleet.headway[i],
        fleet.accel[i],
        fleet.decel[i],
        fleet.standstill[i],
    )


@device_function
def _braking_for_bend(graph: LaneGraph, fleet: Fleet, state: State, i: int, lane: int, ahead: float) -> float:
    """Braking that slows vehicle ``i`` to a bend's speed when it gets there; 0 while there is time."""
    slow = graph.speed[lane] * fleet.eagerness[i]
    if state.speed[i] <= slow:
        return 0.0
    needed = (state.speed[i] ** 2 - slow**2) / (2.0 * max(ahead, 1.0))
    return float(needed) if needed > 0.7 * fleet.decel[i] else 0.0
