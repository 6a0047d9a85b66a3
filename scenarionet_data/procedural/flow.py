"""The time loop of traffic that flows (version 2): vehicles enter at the roads' ends, from before the ego does."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from scenarionet_data.arrays.dtypes import Bool, Float64, Int32, Int64, RecordArray
from scenarionet_data.compiled.decorators import device_function, kernel
from scenarionet_data.procedural.drive import EGO, GENTLE, advance
from scenarionet_data.procedural.following import acceleration
from scenarionet_data.procedural.graph import NONE, LaneGraph
from scenarionet_data.procedural.lane_change import is_accepted
from scenarionet_data.procedural.population import WARM_UP, Population
from scenarionet_data.procedural.vehicles import PLACE, PLACES, occupy, record
from scenarionet_data.procedural.walking import Walkers, record_on_foot, step_on_foot
from scenarionet_data.statistics.summary import box_gap

LATEST = 10.0
"""Time for which the ego waits for a gap [s]; then the vehicles on its lane are taken away."""
_KEPT_CLEAR = 5.0
"""Time before the ego enters [s], in which nobody else enters its lane."""
_GIVE_UP = 20.0
"""Time after which a vehicle does not want to enter any more [s]."""


class _Traffic(NamedTuple):
    """Vehicles that come, in the order of ``arrivals``, and working memory for those that are there, the ego first."""

    vehicles: RecordArray
    arrivals: Int64
    pool: RecordArray
    places: RecordArray


def flow(
    graph: LaneGraph, population: Population, walkers: Walkers, lights: Int32, obstacles: Float64, dt: float
) -> tuple[Float64, Bool, int]:
    """Drive from ``WARM_UP`` before the ego enters until it arrives, or the lights' time is over.

    Where two road users touch, the one that came later, but not the ego, is left out and all is driven again.

    Args:
        graph: The lanes.
        population: The vehicles, the ego first, the others in the order of their arrivals; then the people.
        walkers: The people, and where they walk.
        lights: (rows, warm-up, wait and T) states of the lights.
        obstacles: (K, 5) x, y, heading, length, width of what stands on the road.
        dt: Timestep [s].

    Returns:
        (N, t, 4) x, y [m], heading [rad] and speed [m/s], (N, t) whether one is there, and the timestep of the lights
        at which the ego enters.
    """
    count, arrivals, begins = len(population.vehicles), population.arrivals.copy(), walkers.people.begins.copy()
    steps, never = lights.shape[1] - round((WARM_UP + LATEST) / dt), lights.shape[1]
    pool = population.vehicles.copy()
    while True:
        pool.active = False
        places: RecordArray = np.recarray((count, PLACES), PLACE)
        places.lane, places.s = NONE, 0.0
        people = walkers.people.copy()
        people.begins = begins
        motion = np.zeros((count + len(people), steps, 4))
        valid = np.zeros(motion.shape[:2], np.bool_)
        graph.claims[:] = 0
        traffic = _Traffic(population.vehicles, arrivals, pool, places)
        begin, driven = _flow(graph, traffic, Walkers(people, walkers.points), lights, dt, motion, valid)
        motion, valid = motion[:, :driven], valid[:, :driven]
        touching = first_contact(motion, valid, population.size, obstacles)
        if touching == NONE:
            return motion, valid, begin
        if touching < count:
            arrivals[touching] = never
        else:
            begins[touching - count] = never


@kernel
def _flow(
    graph: LaneGraph, traffic: _Traffic, walkers: Walkers, lights: Int32, dt: float, motion: Float64, valid: Bool
) -> tuple[int, int]:
    """Fill ``motion`` and ``valid``, as for :func:`flow`.

    Returns:
        Timestep at which the ego enters, and number of timesteps written.
    """
    vehicles, arrivals, pool, places = traffic
    people = walkers.people
    count, steps = len(vehicles), valid.shape[1]
    wanted, waits, row = np.zeros(count), np.ones(count, np.bool_), np.zeros(count, np.int64)
    num, begin = 1, NONE
    for t in range(lights.shape[1]):
        for i in range(count):
            if not waits[i] or arrivals[i] > t:
                continue
            slot = EGO
            if i != EGO:
                slot = 1
                while slot < num and pool[slot].active:
                    slot += 1
            pool[slot : slot + 1] = vehicles[i : i + 1]
            late = (t - arrivals[i]) * dt
            if i == EGO and late >= LATEST:
                for j in range(num):
                    for place in range(PLACES):
                        if places[j, place].lane == vehicles[EGO].lane:
                            pool[j].active = False
            is_held = begin == NONE and i != EGO and vehicles[i].lane == vehicles[EGO].lane
            is_held = is_held and (arrivals[EGO] - t) * dt < _KEPT_CLEAR
            if not is_held and _enter(graph, pool[: max(num, slot + 1)], places, slot):
                waits[i], row[slot] = False, i
                num = max(num, slot + 1)
                if i == EGO:
                    begin = t
            elif i != EGO and (arrivals[i] == 0 or late > _GIVE_UP):
                waits[i] = False
        while num > 1 and not pool[num - 1].active:
            num -= 1
        present = pool[:num]
        if begin != NONE:
            for i in range(num):
                if present[i].active:
                    record(graph, present[i], motion[row[i], t - begin])
                    valid[row[i], t - begin] = True
            for i in range(len(people)):
                if people[i].begins <= t and not people[i].gone:
                    record_on_foot(walkers, i, motion[count + i, t - begin])
                    valid[count + i, t - begin] = True
            if not present[EGO].active:
                return begin, t - begin
            if t + 1 - begin == steps:
                break
        for i in range(len(people)):
            if people[i].begins <= t and not people[i].gone:
                step_on_foot(graph, present, places, lights, t, people, i, dt)
        advance(graph, present, places, lights, t, row, wanted, dt)
    return begin, steps


@device_function
def _enter(graph: LaneGraph, vehicles: RecordArray, places: RecordArray, i: int) -> bool:
    """Let vehicle ``i`` enter, no faster than the traffic ahead allows; returns whether there is a gap for it."""
    vehicle = vehicles[i]
    while vehicle.speed > 0.5 and acceleration(graph, vehicles, places, i) < -GENTLE:
        vehicle.speed *= 0.9
    if not is_accepted(graph, vehicles, places, i, vehicle.lane, vehicle.s, True):
        return False
    vehicle.active = True
    occupy(graph, vehicles, places, i)
    return True


@kernel
def first_contact(motion: Float64, valid: Bool, size: Float64, obstacles: Float64) -> int:
    """Row of the later one, which is not the ego, of the first two that touch; -1 where nobody does.

    Args:
        motion: (N, T, 4) x, y, heading and speed.
        valid: (N, T).
        size: (N, 3) length, width and height [m].
        obstacles: (K, 5) x, y, heading, length and width.
    """
    box, other, there = np.zeros(5), np.zeros(5), np.zeros(len(motion), np.int64)
    for t in range(valid.shape[1]):
        num = 0
        for i in range(len(motion)):
            if not valid[i, t]:
                continue
            box[:3], box[3:] = motion[i, t, :3], size[i, :2]
            for k in range(num + len(obstacles)):
                if k >= num:
                    other[:] = obstacles[k - num]
                else:
                    other[:3], other[3:] = motion[there[k], t, :3], size[there[k], :2]
                reach = 0.5 * (box[3] + box[4] + other[3] + other[4])
                if (box[0] - other[0]) ** 2 + (box[1] - other[1]) ** 2 < reach * reach and box_gap(box, other) == 0.0:
                    return int(i)
            there[num] = i
            num += 1
    return NONE
