"""Rows of flat buffers for agents: each world has a number of seats, which its agents take and leave."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from scenarionet_data.arrays.compiled import device_function, kernel
from scenarionet_data.arrays.dtypes import Bool, Float32, Float64, Int32, Int64, UInt8
from scenarionet_sim.kernels.scoring import TERMS
from scenarionet_sim.task.task import ARRIVED, DRIVING, TIMED_OUT

_NUM_TERMS = len(TERMS)


class Seats(NamedTuple):
    """Rows of W worlds with S seats each, for agents among up to N objects; ``FlatEnv`` describes the others.

    Attributes:
        row_of: (W, N) row of each object; -1 without one.
        ended: (W, 2) number of agents of the episode that ended, and of those that arrived.
        observations, last_observations: (W * S, D).
        rewards, terminals, truncations, arrivals, masks: (W * S,).
        last_numbers: (W * S, 14).
    """

    row_of: Int32
    ended: Int64
    observations: Float32
    last_observations: Float32
    rewards: Float32
    terminals: Bool
    truncations: Bool
    arrivals: Bool
    masks: Bool
    last_numbers: Float64

    @classmethod
    def of(cls, num_worlds: int, num_agents: int, num_values: int, num_numbers: int) -> Seats:
        """Return seats without agents."""
        values = np.zeros((2, num_agents, num_values), np.float32)
        terminals, truncations, arrivals, masks = np.zeros((4, num_agents), np.bool_)
        return cls(
            np.full((num_worlds, 0), -1, np.int32), np.zeros((num_worlds, 2), np.int64), values[0], values[1],
            np.zeros(num_agents, np.float32), terminals, truncations, arrivals, masks,
            np.zeros((num_agents, num_numbers)),
        )  # fmt: skip


@kernel(allocates=False)
def seat_worlds(slots: Int64, agents: Int32, first: Int32, observed: Float32, seats: Seats) -> None:
    """Give rows to the agents of worlds that begin an episode, with their first observations.

    Args:
        slots: (B,) the worlds.
        agents: (A, 2) world and row of each agent.
        first: (W + 1,) first agent of each world.
        observed: (A, D) observations.
        seats: Written.
    """
    count = len(seats.masks) // len(seats.row_of)
    for b in range(len(slots)):
        w = slots[b]
        seats.ended[w, 0], seats.ended[w, 1] = 0, 0
        for n in range(seats.row_of.shape[1]):
            seats.row_of[w, n] = -1
        for row in range(w * count, (w + 1) * count):
            seats.masks[row] = False
            _clear(seats.observations[row])
        for a in range(first[w], first[w + 1]):
            row = _seat(w, agents[a, 1], seats)
            if row >= 0:
                _copy(observed[a], seats.observations[row])


@kernel(allocates=False)
def settle(
    agents: Int32,
    status: UInt8,
    numbers: Float64,
    observed: Float32,
    can_end: Bool,
    is_due: Bool,
    seats: Seats,
    is_over: Bool,
    retires: Bool,
) -> int:
    """Write the results of a step to the rows of the agents; those that ended leave theirs.

    Args:
        agents: (A, 2) world and row of each agent.
        status: (A,) codes of ``Status``.
        numbers: (A, 14) see ``StepResult``.
        observed: (A, D) observations.
        can_end: (W,) worlds in which agents may end.
        is_due: (W,) worlds in which agents may still appear.
        seats: Written.
        is_over: (W,) output: worlds in which agents ended, and none is left or due.
        retires: (A,) output: agents that ended in other worlds.

    Returns:
        Number of agents that ended.
    """
    for row in range(len(seats.rewards)):
        seats.rewards[row] = 0.0
        seats.terminals[row] = seats.truncations[row] = seats.arrivals[row] = False
    for w in range(len(is_over)):
        is_over[w] = False
    num_ended, first = 0, 0
    while first < len(agents):
        w, end = agents[first, 0], first
        while end < len(agents) and agents[end, 0] == w:
            _write(end, w, agents[end, 1], numbers, observed, seats)
            end += 1
        count = 0
        for a in range(first, end):
            retires[a] = can_end[w] and status[a] != DRIVING
            if retires[a]:
                count += 1
                _leave(w, agents[a, 1], status[a], numbers[a], seats)
        if count == end - first and not is_due[w]:
            is_over[w] = True
            for a in range(first, end):
                retires[a] = False
        num_ended, first = num_ended + count, end
    return num_ended


@device_function
def _seat(w: int, n: int, seats: Seats) -> int:
    """Give the first free row of a world to one of its objects; return it, or -1 if none is free."""
    count = len(seats.masks) // len(seats.row_of)
    for row in range(w * count, (w + 1) * count):
        if not seats.masks[row]:
            seats.masks[row], seats.row_of[w, n] = True, row
            return row
    return -1


@device_function
def _write(a: int, w: int, n: int, numbers: Float64, observed: Float32, seats: Seats) -> None:
    """Write the reward and the observation of an agent to its row, or to a free one."""
    row = seats.row_of[w, n]
    if row < 0:
        row = _seat(w, n, seats)
    if row < 0:
        return
    reward = 0.0
    for term in range(_NUM_TERMS):
        reward += numbers[a, term]
    seats.rewards[row] = reward
    _copy(observed[a], seats.observations[row])


@device_function
def _leave(w: int, n: int, status: int, numbers: Float64, seats: Seats) -> None:
    """Let an agent that ended leave its row, if it has one."""
    row = seats.row_of[w, n]
    seats.ended[w, 0] += 1
    seats.ended[w, 1] += status == ARRIVED
    seats.row_of[w, n] = -1
    if row < 0:
        return
    seats.truncations[row], seats.terminals[row] = status == TIMED_OUT, status != TIMED_OUT
    seats.arrivals[row] = status == ARRIVED
    for k in range(len(numbers)):
        seats.last_numbers[row, k] = numbers[k]
    _copy(seats.observations[row], seats.last_observations[row])
    _clear(seats.observations[row])
    seats.masks[row] = False


@device_function
def _copy(source: Float32, target: Float32) -> None:
    for k in range(len(source)):
        target[k] = source[k]


@device_function
def _clear(values: Float32) -> None:
    for k in range(len(values)):
        values[k] = 0.0
