"""The time loop of the traffic: from a lane graph and vehicles to their motion, the same bits on every run."""

from __future__ import annotations

import numpy as np

from scenarionet_data.arrays.compiled import device_function, kernel
from scenarionet_data.arrays.dtypes import Bool, Float64, Int32
from scenarionet_data.procedural.following import acceleration, room_needed
from scenarionet_data.procedural.graph import NONE, LaneGraph
from scenarionet_data.procedural.lane_change import carry_on, consider
from scenarionet_data.procedural.right_of_way import update_grant
from scenarionet_data.procedural.vehicles import (
    Fleet,
    Places,
    State,
    curvature_at,
    lateral_offset,
    occupy,
    record,
)

EGO = 0
_LAST_CHANCE = 10.0  # [m] before a vehicle would have to stop and wait to change lanes
_CONSIDER_EVERY = 5  # timesteps between thoughts of a lane change
_GENTLE = 2.0  # [m/s2] nobody has to brake harder at the start


@kernel
def drive(graph: LaneGraph, fleet: Fleet, state: State, lights: Int32, dt: float, motion: Float64, valid: Bool) -> int:
    """Drive until the ego arrives or time is over.

    Time is a loop because every step follows from the one before.

    Args:
        graph: The lanes.
        fleet: What drives on them; vehicle 0 is the ego.
        state: Where it starts; changed in place.
        lights: (rows, T) states of the lights.
        dt: Timestep [s].
        motion: (N, T, 4), written: x, y, heading, speed.
        valid: (N, T), written.

    Returns:
        Number of timesteps written.
    """
    count, steps = valid.shape
    places = Places(np.full((count, 3), NONE, dtype=np.int32), np.zeros((count, 3)))
    wanted = np.zeros(count)
    for i in range(count):
        occupy(graph, fleet, state, places, i)
    _calm_start(graph, fleet, state, places, lights)
    for t in range(steps):
        for i in range(count):
            if state.active[i]:
                record(graph, state, i, motion[i, t])
                valid[i, t] = True
        if not state.active[EGO]:
            return t
        for i in range(count):
            if state.active[i]:
                _decide(graph, fleet, state, places, lights, t, i)
        for i in range(count):
            if state.active[i]:
                wanted[i] = acceleration(graph, fleet, state, places, i)
        for i in range(count):
            if state.active[i]:
                _move(graph, state, i, wanted[i], dt)
            occupy(graph, fleet, state, places, i)
    return int(steps)


@device_function
def _calm_start(graph: LaneGraph, fleet: Fleet, state: State, places: Places, lights: Int32) -> None:
    """Lower the speeds drawn at random until nobody has to brake hard in the first step."""
    for i in range(len(state.lane)):
        update_grant(graph, fleet, state, places, lights, 0, i)
    for _ in range(3):
        for i in range(len(state.lane)):
            while state.speed[i] > 0.5 and acceleration(graph, fleet, state, places, i) < -_GENTLE:
                state.speed[i] *= 0.9


@device_function
def _decide(graph: LaneGraph, fleet: Fleet, state: State, places: Places, lights: Int32, t: int, i: int) -> None:
    """Lane change, destination and right of way of one vehicle; others see the outcome at once."""
    if (t + i) % _CONSIDER_EVERY == 0:
        consider(graph, fleet, state, places, i)
    _reroute(graph, state, i)
    occupy(graph, fleet, state, places, i)
    update_grant(graph, fleet, state, places, lights, t, i)


@device_function
def _reroute(graph: LaneGraph, state: State, i: int) -> None:
    """Whoever is too late to change lanes goes where its lane leads, except the ego."""
    lane, destination = state.lane[i], state.destination[i]
    is_end = graph.exit_first[lane] == graph.exit_first[lane + 1]
    if i == EGO or is_end or graph.next_lane[destination, lane] != NONE:
        return
    if graph.length[lane] - state.s[i] < room_needed(graph, state, i, lane) + _LAST_CHANCE:
        for other in range(len(graph.cost)):
            if graph.next_lane[other, lane] != NONE:
                state.destination[i] = other
                return


@device_function
def _move(graph: LaneGraph, state: State, i: int, acceleration_now: float, dt: float) -> None:
    """Move one vehicle by a step of constant acceleration, along its curve and over lane ends."""
    speed = max(0.0, state.speed[i] + acceleration_now * dt)
    left, slope = lateral_offset(state, i)
    stretch = np.hypot(1.0 - curvature_at(graph, state.lane[i], state.s[i]) * left, slope)
    travelled = 0.5 * (state.speed[i] + speed) * dt / stretch
    state.speed[i] = speed
    state.s[i] += travelled
    carry_on(state, i, travelled, dt)
    while state.active[i] and state.s[i] >= graph.length[state.lane[i]]:
        _enter_next(graph, state, i)


@device_function
def _enter_next(graph: LaneGraph, state: State, i: int) -> None:
    lane = state.lane[i]
    following = graph.next_lane[state.destination[i], lane]
    if following == NONE:
        state.active[i] = False
        return
    if state.origin[i] != NONE:
        state.origin[i] = graph.right[following] if state.lateral[i] < 0.0 else graph.left[following]
    state.s[i] -= graph.length[lane]
    state.previous[i], state.lane[i] = lane, following
    if state.granted[i] == following:
        state.granted[i] = NONE
