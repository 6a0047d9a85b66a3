"""Reward, termination and running statistics of agents after a step."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from scenarionet_data.arrays.dtypes import Bool, Float64, Int32, Int64, UInt8
from scenarionet_data.compiled.decorators import device_function, kernel
from scenarionet_data.scenario.vocabulary import ObjectType
from scenarionet_sim.arrays.log import ARC, VALID, VX, VY, X, Y
from scenarionet_sim.arrays.minmax import larger, smaller
from scenarionet_sim.arrays.structures import LOG, NUM_OBJECTS, NUM_STEPS, OBJECTS, Recorded, StateArrays
from scenarionet_sim.task.task import ARRIVED, DRIVING, OFF_ROUTE, TIMED_OUT

ROAD_USERS = np.uint32(sum(1 << kind for kind in (ObjectType.VEHICLE, ObjectType.PEDESTRIAN, ObjectType.CYCLIST)))
"""Bits of the types that count as vehicles and humans; all others are objects."""

TERMS = ("displacement", "smoothness", "collision", "terminal")
"""Terms of the reward: the first rows of ``StepResult.numbers``."""

NUMBERS = (
    *TERMS,
    "route_completion",
    "lateral",
    "cost",
    "vehicle_crashes",
    "human_crashes",
    "object_crashes",
    "speed",
    "mean_speed",
    "distance_to_log",
    "mean_distance_to_log",
)
"""Rows of ``StepResult.numbers``."""

COMPLETION, _LATERAL, _COST, _CRASHES, _SPEED, _MEAN_SPEED, _DISTANCE, _MEAN_DISTANCE = 4, 5, 6, 7, 10, 11, 12, 13
_VEHICLE, _PEDESTRIAN, _CYCLIST = int(ObjectType.VEHICLE), int(ObjectType.PEDESTRIAN), int(ObjectType.CYCLIST)
_STEPS, _SPEEDS, _LOG_STEPS, _LOG_DISTANCES, _LAST_DISTANCE, _LAST_SPEED = range(3, 9)  # of totals, after crashes
NUM_TOTALS = 9
"""Sums over the episode, by object: crashes with vehicles, humans and objects; steps, speeds; steps with a recorded
position, distances from it, and the last of these; the last speed."""

_NUM_TERMS = len(TERMS)


TERMINATED, TRUNCATED, HAS_ARRIVED, HAS_LEFT, IS_LATE = range(5)
"""Rows of ``StepResult.flags``: it arrived or left its route; its time is over; each of these three by itself."""

NUM_FLAGS = 5


class StepResult(NamedTuple):
    """Result of a step for agents at C places, undefined at free ones.

    Attributes:
        rewards: (C,) sums of the terms.
        numbers: (14, C) weighted terms of the reward; completed share of the route; lateral offset from it [m];
            crashes that begin in this step; crashes so far with vehicles, humans and objects; speed now and on
            average [m/s]; distance from the recorded position, last known and on average [m].
        flags: (5, C) see ``TERMINATED``.
        status: (C,) codes of ``Status``.
        timestep: (C,) of their worlds.
    """

    rewards: Float64
    numbers: Float64
    flags: Bool
    status: UInt8
    timestep: Int32

    @classmethod
    def of(cls, num_places: int) -> StepResult:
        """Allocate results, of undefined values."""
        return cls(
            np.empty(num_places), np.empty((len(NUMBERS), num_places)), np.empty((NUM_FLAGS, num_places), np.bool_),
            np.empty(num_places, np.uint8), np.empty(num_places, np.int32),
        )  # fmt: skip


Touched = tuple[Bool, Bool, np.uint32]


@kernel(allocates=False)
def list_ended(status: UInt8, places: Int64) -> int:
    """List the places (C,) of the agents that have ended, by their status (C,); return their number."""
    count = 0
    for a in range(len(status)):
        if status[a] != DRIVING:
            places[count] = a
            count += 1
    return count


@device_function
def clear_score(a: int, result: StepResult) -> None:
    """Write the result of an agent whose episode begins."""
    for k in range(len(result.numbers)):
        result.numbers[k, a] = 0.0
    _end(a, DRIVING, result)


@device_function
def excuse(a: int, result: StepResult) -> None:
    """Take the reward and the end from the result of an agent that has appeared in this step."""
    for k in range(_NUM_TERMS):
        result.numbers[k, a] = 0.0
    _end(a, DRIVING, result)


@device_function
def _end(a: int, status: int, result: StepResult) -> None:
    """Write the status of an agent, and the reward from its terms."""
    result.status[a], result.rewards[a] = status, 0.0
    for k in range(_NUM_TERMS):
        result.rewards[a] += result.numbers[k, a]
    has_arrived, has_left, is_late = status == ARRIVED, status == OFF_ROUTE, status == TIMED_OUT
    flags = result.flags
    flags[HAS_ARRIVED, a], flags[HAS_LEFT, a], flags[IS_LATE, a] = has_arrived, has_left, is_late
    flags[TERMINATED, a], flags[TRUNCATED, a] = has_arrived or has_left, is_late


@device_function
def score(
    a: int,
    w: int,
    n: int,
    steering: float,
    touched: Touched,
    routes: tuple[Float64, Float64],
    now: StateArrays,
    recorded: Recorded,
    task: Float64,
    totals: Float64,
    result: StepResult,
) -> None:
    """Write the result of a step for the agent at place ``a``, row ``n`` of world ``w``.

    An agent both beyond the end of its route and off it has left it: it must arrive on the route. A crash begins when
    an agent touches an object that it did not touch a step before. The distance from the recording is measured in
    the plane, at timesteps with a recorded position.

    Args:
        a, w, n: The agent.
        steering: First number of its action, in [-1, 1].
        touched: (N,) objects that it touches, (N,) those a step before, and types of the former as bits.
        routes: (2,) location on the reference trajectory, now and a step before; see ``State``.
        now: Current state.
        recorded: Logs and paths.
        task: (16,) see ``task.task_parameters``.
        totals: (W, N, 9) see ``NUM_TOTALS``; increased.
        result: Output.
    """
    # Indexed, since unpacking an array compiles an iterator for every name.
    c1, c2, c3 = task[0], task[1], task[2]
    p_road_user, p_object = task[3], task[4]
    r_arrived, r_off_route, slow = task[5], task[6], task[7]
    speeding, harshness, harsh = task[8], task[9], task[10]
    max_lateral, min_completion = task[11], task[12]
    short_route, extra_steps, dt = task[13], task[14], task[15]
    contacts, before, hits = touched
    route, route_before = routes
    count, num_steps = recorded.place[w, NUM_OBJECTS], recorded.place[w, NUM_STEPS]
    row, t, path_row = now.motion[w, n], now.timestep[w], recorded.place[w, OBJECTS] + n
    numbers, total = result.numbers, totals[w, n]
    speed = np.hypot(row[VX], row[VY])
    first, end = recorded.path_offsets[path_row], recorded.path_offsets[path_row + 1]
    length = recorded.path[end - 1, ARC] if end > first else 0.0
    is_short = length < short_route
    done = 1.0 if is_short else smaller(larger(route[0] / length, 0.0), 1.0)
    status, terminal = DRIVING, 0.0
    if abs(route[1]) > max_lateral:
        status, terminal = OFF_ROUTE, r_off_route
    elif is_short or done > min_completion:
        status, terminal = ARRIVED, r_arrived
    elif t >= num_steps + extra_steps:
        status = TIMED_OUT
    collision = 0.0
    if hits & ROAD_USERS:
        collision = p_road_user
    elif hits:
        collision = p_object
    numbers[0, a] = c1 * (route[0] - route_before[0]) if status == DRIVING else 0.0
    numbers[1, a] = c2 * smaller(0.0, 1.0 / speed - abs(steering)) if speed >= slow else c2 * 0.0
    numbers[1, a] += speeding * larger(speed - recorded.top_speed[path_row], 0.0)
    if total[_STEPS] > 0.0:
        numbers[1, a] += harshness * larger(abs(speed - total[_LAST_SPEED]) / dt - harsh, 0.0)
    total[_LAST_SPEED] = speed
    numbers[2, a], numbers[3, a] = c3 * collision, terminal
    numbers[COMPLETION, a], numbers[_LATERAL, a] = done, route[1]
    _end(a, status, result)
    begun = 0
    if hits:
        for m in range(count):
            if contacts[m] and not before[m]:
                begun += 1
                kind = now.object_type[w, m]
                is_human = kind == _PEDESTRIAN or kind == _CYCLIST  # ``in`` takes longer to compile
                total[0 if kind == _VEHICLE else (1 if is_human else 2)] += 1.0
    total[_STEPS] += 1.0
    total[_SPEEDS] += speed
    log_row = recorded.log[recorded.place[w, LOG] + smaller(t, num_steps - 1) * count + n]
    if t < num_steps and log_row[VALID] != 0:
        apart = np.hypot(row[X] - log_row[X], row[Y] - log_row[Y])
        total[_LOG_STEPS] += 1.0
        total[_LOG_DISTANCES] += apart
        total[_LAST_DISTANCE] = apart
    numbers[_COST, a] = begun
    for kind in range(3):
        numbers[_CRASHES + kind, a] = total[kind]
    numbers[_SPEED, a], numbers[_MEAN_SPEED, a] = speed, total[_SPEEDS] / total[_STEPS]
    numbers[_DISTANCE, a] = total[_LAST_DISTANCE]
    numbers[_MEAN_DISTANCE, a] = total[_LOG_DISTANCES] / larger(total[_LOG_STEPS], 1.0)
