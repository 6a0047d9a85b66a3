"""Who may enter a junction: lights, priority, and one vehicle at a time through every conflict.

A lane that conflicts with others is entered only when granted. A grant is given when no vehicle is in, or
has a grant for, a conflicting part of another lane, and none with priority is about to arrive. So crossing
paths are free of collisions by construction, not by braking.
"""

from __future__ import annotations

import numpy as np

from scenarionet_data.arrays.compiled import device_function
from scenarionet_data.arrays.dtypes import Int32
from scenarionet_data.procedural.conflicts import SPLIT
from scenarionet_data.procedural.graph import NONE, LaneGraph
from scenarionet_data.procedural.vehicles import PLACES, Fleet, Places, State

GO, CAUTION, STOP = 1, 2, 3
_FIRM_BRAKING = 3.0  # [m/s2] with which drivers still stop for a light
_GAP = 1.5  # [s] left to who has priority
_CRAWL = 4.0  # [m/s] least speed assumed of who is about to cross
_STANDING = 0.3  # [m/s]
_AT_THE_LINE = 8.0  # [m]
_HOPS = 4


@device_function
def update_grant(graph: LaneGraph, fleet: Fleet, state: State, places: Places, lights: Int32, t: int, i: int) -> None:
    """Grant vehicle ``i`` the next lane that needs it; take that back when its light turns and it can stop.

    Args:
        lights: (rows, T) GO, CAUTION or STOP.
    """
    following, distance = _next_to_grant(graph, state, i)
    if following == NONE:
        return
    ahead = distance - fleet.length[i] / 2.0
    closed = is_closed(graph, lights, t, following, ahead, state.speed[i])
    if state.granted[i] == following:
        if closed:
            state.granted[i] = NONE
        return
    if places.lane[i, 1] != NONE and ahead > _AT_THE_LINE:
        return  # still blocks, and may be blocked by, the lane it leaves
    reach = state.speed[i] ** 2 / (2.0 * fleet.decel[i]) + 12.0
    if ahead < reach and not closed and _is_free(graph, fleet, state, places, lights, t, i, following, ahead):
        state.granted[i] = following


@device_function
def _next_to_grant(graph: LaneGraph, state: State, i: int) -> tuple[int, float]:
    """The first lane ahead of vehicle ``i`` that it may not simply enter, and the distance to it [m]."""
    where, ahead = state.lane[i], -state.s[i]
    for _ in range(_HOPS):
        ahead += graph.length[where]
        where = graph.next_lane[state.destination[i], where]
        if where == NONE or graph.needs_grant[where]:
            return where, ahead
    return NONE, np.inf


@device_function
def is_closed(graph: LaneGraph, lights: Int32, t: int, lane: int, ahead: float, speed: float) -> bool:
    """Whether a light ``ahead`` metres forbids entering ``lane`` to who drives at ``speed``."""
    if graph.signal[lane] == NONE:
        return False
    light = lights[graph.signal[lane], t]
    can_stop = ahead > speed**2 / (2.0 * _FIRM_BRAKING)
    return bool(can_stop and light != GO)


@device_function
def _is_free(
    graph: LaneGraph,
    fleet: Fleet,
    state: State,
    places: Places,
    lights: Int32,
    t: int,
    i: int,
    lane: int,
    ahead: float,
) -> bool:
    for row in range(graph.conflict_first[lane], graph.conflict_first[lane + 1]):
        other, kind = graph.conflicts[row, 0], graph.conflicts[row, 1]
        if kind == SPLIT:
            continue
        zone = graph.conflict_zones[row]
        pace = max(state.speed[i], _CRAWL)
        leave = (ahead + min(zone[1], graph.length[lane]) + fleet.length[i]) / pace
        for j in range(len(state.lane)):
            if j == i or not state.active[j]:
                continue
            if _is_in(fleet, state, places, j, other, zone[3]):
                return False
            if graph.rank[other] > graph.rank[lane]:
                red = graph.signal[other] != NONE and lights[graph.signal[other], t] == STOP
                if not red and _arrival(graph, state, j, other, zone[2]) < leave + _GAP:
                    return False
    return True


@device_function
def _is_in(fleet: Fleet, state: State, places: Places, j: int, lane: int, zone_end: float) -> bool:
    """Whether vehicle ``j`` has a grant for ``lane`` or is on it, its rear not yet past ``zone_end``."""
    if state.granted[j] == lane:
        return True
    for place in range(PLACES):
        if places.lane[j, place] == lane and places.s[j, place] - fleet.length[j] / 2.0 < zone_end:
            return True
    return False


@device_function
def _arrival(graph: LaneGraph, state: State, j: int, lane: int, zone_begin: float) -> float:
    """Time until vehicle ``j`` is at ``zone_begin`` of ``lane`` [s]; infinite when its route avoids it.

    Who stands still without a light to wait for may itself be waiting: it has no priority until it moves.
    """
    if state.speed[j] < _STANDING and graph.signal[lane] == NONE:
        return np.inf
    ahead, where = -state.s[j], state.lane[j]
    for _ in range(_HOPS):
        if where == lane:
            return float(max(ahead + zone_begin, 0.0) / max(state.speed[j], _CRAWL))
        ahead += graph.length[where]
        where = graph.next_lane[state.destination[j], where]
        if where == NONE:
            break
    return np.inf
