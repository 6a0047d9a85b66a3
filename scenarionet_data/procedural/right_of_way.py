"""Right of way: which vehicle may enter a junction, by lights, priority and conflicting lanes.

A lane that conflicts with others is entered only when granted. A grant requires that no vehicle is in, or
has a grant for, a conflicting part of another lane, and that none with priority is about to arrive. So crossing
paths are free of collisions by construction, not by braking.
"""

from __future__ import annotations

import numpy as np

from scenarionet_data.arrays.dtypes import ArrayRecord, Int32, RecordArray
from scenarionet_data.compiled.decorators import device_function
from scenarionet_data.procedural.graph import NONE, SPLIT, LaneGraph
from scenarionet_data.procedural.vehicles import PLACES

GO, CAUTION, STOP = 1, 2, 3
_FIRM_BRAKING = 3.0  # [m/s2] with which drivers still stop for a light
_GAP = 1.5  # [s] left to vehicles with priority
_CRAWL = 4.0  # [m/s] least speed assumed of a vehicle about to cross
_STANDING = 0.3  # [m/s]
_AT_THE_LINE = 8.0  # [m]
_HOPS = 4


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
    if vehicle.granted == following:
        if closed:
            vehicle.granted = NONE
        return
    if places[i, 1].lane != NONE and ahead > _AT_THE_LINE:
        return  # still blocks, and may be blocked by, the lane it leaves
    reach = vehicle.speed**2 / (2.0 * vehicle.decel) + 12.0
    if ahead < reach and not closed and _is_free(graph, vehicles, places, lights, t, i, following, ahead):
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
                return False
            has_priority = other.rank > own.rank and not is_red
            if has_priority and _arrival(graph, vehicles[j], conflict.lane, conflict.other_begin) < leave + _GAP:
                return False
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
    if vehicle.speed < _STANDING and graph.lanes[lane].signal == NONE:
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
