"""People on foot in the time loop: they walk along their path, and wait at the kerb for lights, gaps and courage."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from scenarionet_data.arrays.dtypes import Float64, Int32, RecordArray
from scenarionet_data.compiled.decorators import device_function
from scenarionet_data.procedural.graph import LaneGraph
from scenarionet_data.procedural.right_of_way import is_driven_on, is_red_for

SPACING = 0.25  # [m] between the points of paths
_GAIN = 1.5  # [m/s2] with which people start and stop
_APART = 1.0  # [m] that people keep from the one ahead of them
_SOON = 5.0  # [s] within which one that waits without a light asks drivers to stop

WALKER = np.dtype(
    [
        ("points_begin", "i8"),  # rows of `Walkers.points`
        ("length", "f8"),  # of the path [m]
        ("kerb", "f8"),  # where it waits before the road [m]; infinite where the path does not cross one
        ("beyond", "f8"),  # where it has left the road [m]
        ("walk", "i8"),  # the crosswalk
        ("pace", "f8"),  # [m/s]
        ("hesitation", "f8"),  # time that it stands at the kerb at least [s]
        ("begins", "i8"),  # timestep
        ("s", "f8"),
        ("speed", "f8"),
        ("waited", "f8"),  # [s]
        ("gone", "?"),  # whether it is at its path's end
        ("claims", "?"),  # whether it is on the crosswalk, or drivers are to stop for it
        ("crosses", "?"),  # whether it has left the kerb
    ],
    align=True,
)
"""One that walks, and the state that the kernels change in place."""


class Walkers(NamedTuple):
    """People on foot.

    Attributes:
        people: (P,) ``WALKER`` records, in any order.
        points: (Q, 3) x, y [m] and heading [rad] along paths, ``SPACING`` apart.
    """

    people: RecordArray
    points: Float64


@device_function
def step_on_foot(
    graph: LaneGraph,
    vehicles: RecordArray,
    places: RecordArray,
    lights: Int32,
    t: int,
    people: RecordArray,
    i: int,
    dt: float,
) -> None:
    """Move one that walks by a timestep; drivers see by ``graph.claims`` that a crosswalk is taken."""
    person = people[i]
    if not person.crosses and person.s > person.kerb - 0.1 and person.speed < 0.1:
        person.waited += dt
        duration = (person.beyond - person.kerb) / person.pace + person.pace / _GAIN
        is_free = is_red_for(graph, lights, person.walk, t, int(duration / dt) + 1)
        if is_free and not person.claims and person.waited > min(person.hesitation, _SOON):
            person.claims = True
            graph.claims[person.walk] += 1
        if not is_free and person.claims:
            person.claims = False
            graph.claims[person.walk] -= 1
        if (
            person.claims
            and person.waited > person.hesitation
            and not is_driven_on(graph, vehicles, places, person.walk)
        ):
            person.crosses = True
    elif person.claims and person.s > person.beyond:
        person.claims = False
        graph.claims[person.walk] -= 1
    most = person.pace
    if not person.crosses and person.s < person.kerb:
        most = min(most, np.sqrt(2.0 * _GAIN * max(person.kerb - person.s, 0.0)))
    elif not person.crosses:
        most = 0.0
    for j in range(len(people)):  # nobody overtakes
        other = people[j]
        ahead = other.s - person.s
        is_there = other.points_begin == person.points_begin and other.begins <= t and not other.gone
        if is_there and (ahead > 0.0 or (ahead == 0.0 and j < i)):
            most = min(most, np.sqrt(2.0 * _GAIN * max(ahead - _APART, 0.0)))
    speed = max(min(most, person.speed + _GAIN * dt), person.speed - 2.0 * _GAIN * dt, 0.0)
    person.s += 0.5 * (person.speed + speed) * dt
    person.speed = speed
    person.gone = person.s >= person.length


@device_function
def record_on_foot(walkers: Walkers, i: int, motion: Float64) -> None:
    """Write x, y, heading and speed of one that walks into ``motion`` (4,)."""
    person = walkers.people[i]
    at = person.s / SPACING
    row = int(at)
    u, first = at - row, person.points_begin + row
    for axis in range(3):
        motion[axis] = (1.0 - u) * walkers.points[first, axis] + u * walkers.points[first + 1, axis]
    motion[3] = person.speed
