"""Lane changes: to follow the route, to pass road works, or for advantage (MOBIL)."""

from __future__ import annotations

import numpy as np

from scenarionet_data.arrays.compiled import device_function
from scenarionet_data.procedural.following import braking_along, nearest_on, room_needed
from scenarionet_data.procedural.graph import NONE, LaneGraph
from scenarionet_data.procedural.idm import free_acceleration, interaction, is_worth_changing
from scenarionet_data.procedural.routes import LANE_CHANGE_COST
from scenarionet_data.procedural.vehicles import PLACES, Fleet, Places, State

SHORTEST = 12.0  # [m] over which a lane change is done
DURATION = 3.2  # [s] a lane change usually takes
SAFE_BRAKING = 3.0  # [m/s2] a lane change may cost anyone
THRESHOLD = 0.3  # [m/s2] of advantage worth a lane change
PATIENCE = 4.0  # [s] between lane changes for advantage
_CLOSED_AHEAD = 120.0  # [m] at which road works are seen
STOPPING_ROOM = 6.0  # [m] that drivers keep between their centre and where they have to stop
_FORESIGHT = 2.0  # [s] for which who is ahead is expected to drive on
_GAP = 2.0  # [m] bumper to bumper, at least
_HOPS = 3


@device_function
def consider(graph: LaneGraph, fleet: Fleet, state: State, places: Places, i: int) -> None:
    """Start a lane change of vehicle ``i`` if it must or should, and can."""
    if state.lateral[i] != 0.0:
        return
    lane = state.lane[i]
    for side in (1.0, -1.0):
        target = graph.left[lane] if side > 0.0 else graph.right[lane]
        if target == NONE:
            continue
        s = state.s[i] * graph.length[target] / graph.length[lane]
        must = _must(graph, state, i, lane, target)
        if not must and (state.patience[i] > 0.0 or _is_detour(graph, state, i, lane, target)):
            continue
        span = _span(graph, state, i, lane, target, s, side)
        if span == 0.0 or _is_closed(graph, target, s):
            continue
        if not _is_way_clear(graph, fleet, state, places, i, target, s, span):
            continue
        if _is_accepted(graph, fleet, state, places, i, target, s, must):
            _start(graph, state, i, target, s, span, side)
            return


@device_function
def _must(graph: LaneGraph, state: State, i: int, lane: int, target: int) -> bool:
    """Whether the route leads over ``target``, or road works close this lane."""
    ahead = graph.blocked[lane, 0] - state.s[i]
    if -SHORTEST < ahead < _CLOSED_AHEAD and np.isinf(graph.blocked[target, 0]):
        return True
    cost = graph.cost[state.destination[i]]
    return bool(cost[target] + LANE_CHANGE_COST / 2.0 < cost[lane])


@device_function
def _is_detour(graph: LaneGraph, state: State, i: int, lane: int, target: int) -> bool:
    cost = graph.cost[state.destination[i]]
    return bool(cost[target] > cost[lane] + LANE_CHANGE_COST / 2.0)


@device_function
def _is_closed(graph: LaneGraph, target: int, s: float) -> bool:
    """Whether road works on ``target`` are near ``s``."""
    begin, end = graph.blocked[target, 0], graph.blocked[target, 1]
    return bool(begin - 60.0 < s < end + 8.0)


@device_function
def _span(graph: LaneGraph, state: State, i: int, lane: int, target: int, s: float, side: float) -> float:
    """Distance over which vehicle ``i`` would change lanes [m]; 0 when there is not enough."""
    span = max(SHORTEST, DURATION * state.speed[i])
    shortest = max(SHORTEST, 0.55 * span)
    room = graph.length[target] - s - STOPPING_ROOM - max(0.0, room_needed(graph, state, i, target))
    following = graph.next_lane[state.destination[i], target]
    if following != NONE:
        behind = graph.right[following] if side > 0.0 else graph.left[following]
        if behind != NONE:
            room = np.inf
    ahead = graph.blocked[lane, 0] - state.s[i]
    if ahead > 0.0:
        room = min(room, ahead - 2.0)
    return 0.0 if room < shortest else float(min(span, room))


@device_function
def _is_way_clear(
    graph: LaneGraph, fleet: Fleet, state: State, places: Places, i: int, target: int, s: float, span: float
) -> bool:
    """Whether both lanes are free far enough ahead to finish within ``span``, rather than stand across them."""
    gap, speed = nearest_on(graph, fleet, state, places, i, target, -s)
    if gap + _FORESIGHT * speed < span:
        return False
    gap, speed = nearest_on(graph, fleet, state, places, i, state.lane[i], -state.s[i])
    return bool(gap + _FORESIGHT * speed > 0.5 * span)


@device_function
def _is_accepted(
    graph: LaneGraph, fleet: Fleet, state: State, places: Places, i: int, target: int, s: float, must: bool
) -> bool:
    """Whether the gap in ``target`` is safe and, unless the change is a must, worth it."""
    braking = braking_along(graph, fleet, state, places, i, target, s, False)
    desired = graph.speed[target] * fleet.eagerness[i]
    after = free_acceleration(state.speed[i], desired, fleet.accel[i], fleet.decel[i]) - braking
    if after < -SAFE_BRAKING:
        return False
    loss = 0.0
    for j in range(len(state.lane)):
        if j == i or not state.active[j]:
            continue
        gap = _gap_behind(graph, fleet, state, places, i, j, target, s)
        if gap == np.inf:
            continue
        closing = state.speed[j] - state.speed[i]
        yielding = interaction(
            state.speed[j], gap, closing, fleet.headway[j], fleet.accel[j], fleet.decel[j], fleet.standstill[j]
        )
        if gap < _GAP + 0.3 * max(closing, 0.0) or yielding > SAFE_BRAKING + fleet.accel[j]:
            return False
        loss = max(loss, yielding)
    if must:
        return True
    lane = state.lane[i]
    now = braking_along(graph, fleet, state, places, i, lane, state.s[i], False)
    return is_worth_changing(now - braking, loss, fleet.politeness[i], THRESHOLD)


@device_function
def _gap_behind(
    graph: LaneGraph, fleet: Fleet, state: State, places: Places, i: int, j: int, target: int, s: float
) -> float:
    """Gap from vehicle ``j`` to ``i`` at ``s`` on ``target`` if ``j`` is behind or beside, else infinite."""
    halves = (fleet.length[i] + fleet.length[j]) / 2.0
    for place in range(PLACES):
        if places.lane[j, place] == target and abs(places.s[j, place] - s) < halves:
            return 0.0
    for place in range(2):
        where = places.lane[j, place]
        ahead = -places.s[j, place]
        for _ in range(_HOPS):
            if where == NONE:
                break
            if where == target:
                if ahead + s > 0.0:
                    return float(ahead + s - halves)
                break
            ahead += graph.length[where]
            where = graph.next_lane[state.destination[j], where]
    return np.inf


@device_function
def _start(graph: LaneGraph, state: State, i: int, target: int, s: float, span: float, side: float) -> None:
    state.origin[i] = state.lane[i]
    state.lane[i], state.s[i] = target, s
    state.previous[i] = NONE
    state.lateral[i] = -side * graph.lane_width
    state.progress[i], state.span[i] = 0.0, span
    state.patience[i] = PATIENCE
    state.granted[i] = NONE


@device_function
def carry_on(state: State, i: int, travelled: float, dt: float) -> None:
    """Advance the lane change of vehicle ``i`` by ``travelled`` [m], and its patience by ``dt`` [s]."""
    state.patience[i] = max(0.0, state.patience[i] - dt)
    if state.lateral[i] == 0.0:
        return
    state.progress[i] += travelled / state.span[i]
    if state.progress[i] >= 1.0:
        state.lateral[i], state.progress[i], state.origin[i] = 0.0, 0.0, NONE
