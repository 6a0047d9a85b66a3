"""Right of way: which vehicle may enter a junction, by lights, priority and conflicting lanes.

A lane that conflicts with others is entered only when granted. A grant requires that no vehicle is in, or
has a grant for, a conflicting part of another lane, and that none with priority is about to arrive. So crossing
paths are free of collisions by construction, not by braking.
"""

from __future__ import annotations

import numpy as np

from scenarionet_data.arrays.dtypes import ArrayRecord, Int32, RecordArray
from scenarionet_data.compiled.decorators import device_function
from scenarionet_data.procedural.following import nearest_on
from scenarionet_data.procedural.graph import MERGE, NONE, SPLIT, LaneGraph
from scenarionet_data.procedural.vehicles import PLACES, STANDING, desired_speed

GO, CAUTION, STOP = 1, 2, 3
_FIRM_BRAKING = 3.0  # [m/s2] with which drivers still stop for a light
_BETWEEN = 0.5  # [s] from when one has left the place where lanes cross, until the next is there
_GAP = 1.5  # [s] left to vehicles with priority
_CRAWL = 4.0  # [m/s] least speed assumed of a vehicle about to cross
_AT_THE_LINE = 8.0  # [m]
_HOPS = 4
_FORESIGHT = 2.0  # [s] for which the vehicle ahead is expected to drive on
_ROLLING = 2.0  # [m/s] from which it is expected to leave a junction with lights
PATIENCE = 3.0, 6.0  # [s] after which one that waits relies on others to brake, and others let it go first


@device_function
def update_grant(graph: LaneGraph, vehicles: RecordArray, places: RecordArray, lights: Int32, t: int, i: int) -> None:
    """Grant vehicle ``i`` the next lane that needs it; revoke the grant when its light turns and it can stop.

    Args:
        graph, vehicles, places: See ``drive``.
        lights: (rows, T) GO, CAUTION or STOP.
        t: Timestep.
        i: The vehicle.
    """
    vehicle = vehicles[i]
    following, ahead = vehicle.lane, -vehicle.s
    for _ in range(_HOPS):
        ahead += graph.lanes[following].length
        following = graph.routes[vehicle.destination, following].next_lane
        if following == NONE:
            return
        if graph.lanes[following].needs_grant:
            break
    if not graph.lanes[following].needs_grant:
        return
    ahead -= vehicle.length / 2.0
    signal = graph.lanes[following].signal
    can_stop = ahead > vehicle.speed**2 / (2.0 * _FIRM_BRAKING)
    closed = signal != NONE and can_stop and lights[signal, t] != GO
    if graph.flows and closed and lights[signal, t] == CAUTION:  # who waited to turn left does when others stop
        closed = vehicle.waited < PATIENCE[0] and (vehicle.granted != following or ahead > _AT_THE_LINE / 2.0)
    if closed:
        vehicle.waited = 0.0
    if vehicle.granted == following:
        if closed:
            vehicle.granted = NONE
        return
    if places[i, 1].lane != NONE and ahead > _AT_THE_LINE:
        return  # still blocks, and may be blocked by, the lane it leaves
    for row in range(graph.lanes[following].crossings_begin, graph.lanes[following].crossings_end):
        if graph.claims[graph.crossings[row].walk] > 0:
            return  # somebody is on the crosswalk
    reach = vehicle.speed**2 / (2.0 * vehicle.decel) + 12.0
    if ahead < reach and not closed and _is_free(graph, vehicles, places, lights, t, i, following, ahead):
        own = graph.lanes[following]
        is_entering = own.junction != graph.lanes[vehicle.lane].junction and own.detour == 0.0
        if not graph.flows or not is_entering or _is_way_out_clear(graph, vehicles, places, i, following, ahead):
            vehicle.granted = following


@device_function
def _is_free(
    graph: LaneGraph, vehicles: RecordArray, places: RecordArray, lights: Int32, t: int, i: int, lane: int, ahead: float
) -> bool:
    """Whether vehicle ``i``, ``ahead`` metres before ``lane``, can pass all its conflicts."""
    own, vehicle = graph.lanes[lane], vehicles[i]
    pace = max(vehicle.speed, _CRAWL)
    for row in range(own.conflicts_begin, own.conflicts_end):
        conflict = graph.conflicts[row]
        if conflict.kind == SPLIT:
            continue
        other = graph.lanes[conflict.lane]
        leave = (ahead + min(conflict.own_end, own.length) + vehicle.length) / pace
        is_red = other.signal != NONE and lights[other.signal, t] == STOP
        for j in range(len(vehicles)):
            if j == i or not vehicles[j].active:
                continue
            if _is_in(vehicles, places, j, conflict.lane, conflict.other_end):
                if not graph.flows or not _is_gone(graph, vehicles, places, i, j, lane, conflict, ahead):
                    return False
                continue
            has_priority = other.rank > own.rank and not is_red
            if has_priority and graph.flows and vehicle.waited > PATIENCE[0]:
                has_priority = not _lets_pass(graph, vehicles[j], conflict.lane, own.junction)
            if has_priority and _arrival(graph, vehicles[j], conflict.lane, conflict.other_begin) < leave + _GAP:
                return False
            is_outside = graph.lanes[vehicle.lane].junction != own.junction
            if graph.flows and is_outside and own.rank > other.rank and vehicles[j].waited > PATIENCE[1]:
                following = graph.routes[vehicles[j].destination, vehicles[j].lane].next_lane
                if following == conflict.lane and vehicles[j].waited > vehicle.waited:
                    return False
    return True


@device_function
def _is_gone(
    graph: LaneGraph,
    vehicles: RecordArray,
    places: RecordArray,
    i: int,
    j: int,
    lane: int,
    conflict: ArrayRecord,
    ahead: float,
) -> bool:
    """Whether vehicle ``j``, which has a grant for the other lane, is out of the way when ``i`` arrives, or before it.

    Where lanes merge, ``i`` follows it; where they cross, it has left the zone when ``i`` can be there at the earliest.
    """
    own, vehicle, other = graph.lanes[lane], vehicles[i], vehicles[j]
    s = -np.inf
    for place in range(PLACES):
        if places[j, place].lane == conflict.lane:
            s = max(s, places[j, place].s)
    if s == -np.inf:
        if graph.routes[other.destination, other.lane].next_lane != conflict.lane:
            return False
        s = other.s - graph.lanes[other.lane].length
    if conflict.kind == MERGE:
        way = ahead + own.length - vehicle.standstill - other.length / 2.0
        return bool(graph.lanes[conflict.lane].length - s < way)
    if other.speed < STANDING:
        return False
    leaves = (conflict.other_end - s + other.length / 2.0) / max(other.speed, _CRAWL / 2.0)
    way, most = ahead + conflict.own_begin, max(desired_speed(graph, vehicle, lane), vehicle.speed)
    rise = (most - vehicle.speed) / vehicle.accel
    arrives = (np.sqrt(vehicle.speed**2 + 2.0 * vehicle.accel * max(way, 0.0)) - vehicle.speed) / vehicle.accel
    if arrives > rise:
        arrives = rise + (way - 0.5 * (vehicle.speed + most) * rise) / most
    return bool(leaves + _BETWEEN < arrives)


@device_function
def _lets_pass(graph: LaneGraph, vehicle: ArrayRecord, lane: int, junction: int) -> bool:
    """Whether a vehicle with priority, outside of the junction, can stop gently before ``lane`` in it."""
    if graph.lanes[vehicle.lane].junction == junction:
        return False
    ahead, where = -vehicle.s - vehicle.length / 2.0, vehicle.lane
    for _ in range(_HOPS):
        if where in (lane, NONE):
            break
        ahead += graph.lanes[where].length
        where = graph.routes[vehicle.destination, where].next_lane
    return bool(ahead > vehicle.speed**2 / (2.0 * vehicle.decel))


@device_function
def _is_way_out_clear(
    graph: LaneGraph, vehicles: RecordArray, places: RecordArray, i: int, lane: int, ahead: float
) -> bool:
    """Whether there is room for vehicle ``i`` behind ``lane``, so that it does not have to stop where others cross."""
    vehicle, where, is_unlit = vehicles[i], vehicles[i].lane, graph.lanes[lane].signal == NONE
    before, needed = -vehicle.s, ahead + graph.lanes[lane].length + vehicle.length + vehicle.standstill
    for _ in range(_HOPS):
        gap, speed = nearest_on(graph, vehicles, places, i, where, before)
        before += graph.lanes[where].length
        if gap < needed and (speed < _ROLLING or (is_unlit and gap + _FORESIGHT * speed < needed)):
            return False
        where = graph.routes[vehicle.destination, where].next_lane
        if where == NONE or before > needed:
            break
    return True


@device_function
def _is_in(vehicles: RecordArray, places: RecordArray, j: int, lane: int, zone_end: float) -> bool:
    """Whether vehicle ``j`` has a grant for ``lane`` or is on it, its rear not yet past ``zone_end``."""
    if vehicles[j].granted == lane:
        return True
    for place in range(PLACES):
        if places[j, place].lane == lane and places[j, place].s - vehicles[j].length / 2.0 < zone_end:
            return True
    return False


@device_function
def _arrival(graph: LaneGraph, vehicle: ArrayRecord, lane: int, zone_begin: float) -> float:
    """Time until a vehicle is at ``zone_begin`` of ``lane`` [s]; infinite when its route avoids it.

    A vehicle at standstill without a red light may itself be yielding: it has no priority until it moves.
    """
    if vehicle.speed < STANDING and graph.lanes[lane].signal == NONE:
        return np.inf
    ahead, where = -vehicle.s, vehicle.lane
    for _ in range(_HOPS):
        if where == lane:
            return float(max(ahead + zone_begin, 0.0) / max(vehicle.speed, _CRAWL))
        ahead += graph.lanes[where].length
        where = graph.routes[vehicle.destination, where].next_lane
        if where == NONE:
            break
    return np.inf


@device_function
def is_red_for(graph: LaneGraph, lights: Int32, walk: int, t: int, steps: int) -> bool:
    """Whether vehicles that come from the crosswalk's side have red for some timesteps, or no light."""
    for row in range(len(graph.crossings)):
        crossing = graph.crossings[row]
        signal = graph.lanes[crossing.lane].signal
        if crossing.walk != walk or not crossing.is_start or signal == NONE:
            continue
        for later in range(t, min(t + steps, lights.shape[1])):
            if lights[signal, later] != STOP:
                return False
    return True


@device_function
def is_driven_on(graph: LaneGraph, vehicles: RecordArray, places: RecordArray, walk: int) -> bool:
    """Whether a vehicle is on, or has a grant for, a lane that leads over a crosswalk that it has not passed."""
    for row in range(len(graph.crossings)):
        crossing = graph.crossings[row]
        if crossing.walk != walk:
            continue
        for j in range(len(vehicles)):
            if vehicles[j].active and vehicles[j].granted == crossing.lane:
                return True
            for place in range(PLACES):
                is_on = vehicles[j].active and places[j, place].lane == crossing.lane
                if is_on and places[j, place].s - vehicles[j].length / 2.0 < crossing.end:
                    return True
    return False
