"""The time loop of traffic that only leaves (version 1): from vehicles to their motion, the same bits on every run."""

from __future__ import annotations

import numpy as np

from scenarionet_data.arrays.dtypes import ArrayRecord, Bool, Float64, Int32, Int64, RecordArray
from scenarionet_data.compiled.decorators import device_function, kernel
from scenarionet_data.procedural.following import acceleration, room_needed
from scenarionet_data.procedural.graph import NONE, LaneGraph
from scenarionet_data.procedural.lane_change import consider
from scenarionet_data.procedural.right_of_way import update_grant
from scenarionet_data.procedural.vehicles import PLACE, PLACES, STANDING, curvature_at, lateral_offset, occupy, record

EGO = 0
_LAST_CHANCE = 10.0  # [m] before a vehicle would have to stop and wait to change lanes
CONSIDER_EVERY = 5  # timesteps between considerations of a lane change
GENTLE = 2.0  # [m/s2] hardest braking in the first timestep


def drive(graph: LaneGraph, vehicles: RecordArray, lights: Int32, dt: float) -> tuple[Float64, Bool]:
    """Drive until the ego arrives or the lights' time is over.

    Args:
        graph: The lanes.
        vehicles: (N,) ``VEHICLE`` records; vehicle 0 is the ego. Their state is changed in place.
        lights: (rows, T) states of the lights.
        dt: Timestep [s].

    Returns:
        (N, t, 4) x, y [m], heading [rad] and speed [m/s], and (N, t) whether a vehicle is on the map.
    """
    count, steps = len(vehicles), lights.shape[1]
    places: RecordArray = np.recarray((count, PLACES), PLACE)
    places.lane, places.s = NONE, 0.0
    motion, valid = np.zeros((count, steps, 4)), np.zeros((count, steps), np.bool_)
    driven = _drive(graph, vehicles, places, lights, dt, motion, valid)
    return motion[:, :driven], valid[:, :driven]


@kernel
def _drive(
    graph: LaneGraph,
    vehicles: RecordArray,
    places: RecordArray,
    lights: Int32,
    dt: float,
    motion: Float64,
    valid: Bool,
) -> int:
    """Fill ``motion`` and ``valid``; ``places`` (N, 3) is working memory.

    Returns:
        Number of timesteps written.
    """
    count, steps = valid.shape
    rows, wanted = np.arange(count), np.zeros(count)
    for i in range(count):
        occupy(graph, vehicles, places, i)
    for i in range(count):
        update_grant(graph, vehicles, places, lights, 0, i)
    for _ in range(3):  # lower the random initial speeds until no vehicle has to brake hard
        for i in range(count):
            while vehicles[i].speed > 0.5 and acceleration(graph, vehicles, places, i) < -GENTLE:
                vehicles[i].speed *= 0.9
    for t in range(steps):
        for i in range(count):
            if vehicles[i].active:
                record(graph, vehicles[i], motion[i, t])
                valid[i, t] = True
        if not vehicles[EGO].active:
            return t
        advance(graph, vehicles, places, lights, t, rows, wanted, dt)
    return int(steps)


@device_function
def advance(
    graph: LaneGraph,
    vehicles: RecordArray,
    places: RecordArray,
    lights: Int32,
    t: int,
    rows: Int64,
    wanted: Float64,
    dt: float,
) -> None:
    """Move all vehicles by a timestep.

    They decide one after the other, and each sees the decisions of those before it; ``rows`` are their numbers, by
    which they take turns to consider lane changes, and ``wanted`` is working memory, (N,) both.
    """
    for i in range(len(vehicles)):
        if vehicles[i].active:
            if (t + rows[i]) % CONSIDER_EVERY == 0:
                consider(graph, vehicles, places, i)
            reroute(graph, vehicles, i)
            occupy(graph, vehicles, places, i)
            update_grant(graph, vehicles, places, lights, t, i)
    for i in range(len(vehicles)):
        if vehicles[i].active:
            wanted[i] = acceleration(graph, vehicles, places, i)
    for i in range(len(vehicles)):
        if vehicles[i].active:
            move(graph, vehicles[i], wanted[i], dt)
            occupy(graph, vehicles, places, i)


@device_function
def reroute(graph: LaneGraph, vehicles: RecordArray, i: int) -> None:
    """Give a vehicle that is too late to change lanes a destination that its lane leads to, except the ego."""
    vehicle, lane = vehicles[i], vehicles[i].lane
    if i == EGO or graph.lanes[lane].is_last or graph.routes[vehicle.destination, lane].next_lane != NONE:
        return
    if graph.lanes[lane].length - vehicle.s < room_needed(graph, vehicle, lane) + _LAST_CHANCE:
        for other in range(len(graph.routes)):
            if graph.routes[other, lane].next_lane != NONE:
                vehicle.destination = other
                return


@device_function
def move(graph: LaneGraph, vehicle: ArrayRecord, acceleration_now: float, dt: float) -> None:
    """Move one vehicle by a step of constant acceleration, along its curve and over lane ends."""
    speed = max(0.0, vehicle.speed + acceleration_now * dt)
    left, slope = lateral_offset(vehicle)
    left += vehicle.aside
    stretch = np.hypot(1.0 - curvature_at(graph, vehicle.lane, vehicle.s) * left, slope)
    travelled = 0.5 * (vehicle.speed + speed) * dt / stretch
    vehicle.speed = speed
    vehicle.s += travelled
    vehicle.waited = vehicle.waited + dt if speed < STANDING else 0.0
    vehicle.patience = max(0.0, vehicle.patience - dt)
    if vehicle.lateral != 0.0:
        vehicle.progress += travelled / vehicle.span
        if vehicle.progress >= 1.0:
            vehicle.lateral, vehicle.progress, vehicle.origin = 0.0, 0.0, NONE
    while vehicle.active and vehicle.s >= graph.lanes[vehicle.lane].length:
        lane = vehicle.lane
        following = graph.routes[vehicle.destination, lane].next_lane
        if following == NONE:
            vehicle.active = False
            return
        if vehicle.origin != NONE:
            beside = graph.lanes[following]
            vehicle.origin = beside.right if vehicle.lateral < 0.0 else beside.left
        vehicle.s -= graph.lanes[lane].length
        vehicle.previous, vehicle.lane = lane, following
        if vehicle.granted == following:
            vehicle.granted = NONE
