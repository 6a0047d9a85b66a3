"""Rows of flat buffers for agents: the first places of each world."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from scenarionet_data.arrays.dtypes import Bool, Float32, Float64, Int64, UInt8
from scenarionet_data.compiled.decorators import device_function, kernel
from scenarionet_sim.arrays.structures import Recorded, StateArrays
from scenarionet_sim.simulation.agent_kernels import DrivenArrays, is_agent_due
from scenarionet_sim.task.scoring_kernels import NUMBERS, StepResult
from scenarionet_sim.task.task import ARRIVED, DRIVING, TIMED_OUT
from scenarionet_sim.worlds.episode_kernels import UNDRIVEN


class Seats(NamedTuple):
    """Rows of W worlds with S seats each, ``w * S + k`` for the agent at place k < S of world w; see ``FlatEnv``.

    Attributes:
        can_end: (W,) worlds in which agents may end.
        is_over: (W,) worlds in which no agent is left or due.
        ended: (W, 2) number of agents of the episode that ended, and of those that arrived.
        observations, last_observations: (W * S, D).
        rewards, terminals, truncations, arrivals, masks: (W * S,).
        last_numbers: (W * S, 14).
    """

    can_end: Bool
    is_over: Bool
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
    def of(cls, num_worlds: int, num_seats: int, num_values: int) -> Seats:
        """Return seats without agents: S = ``num_seats``, D = ``num_values``."""
        count = num_worlds * num_seats
        values = np.zeros((2, count, num_values), np.float32)
        terminals, truncations, arrivals, masks = np.zeros((4, count), np.bool_)
        return cls(
            np.ones(num_worlds, np.bool_), np.zeros(num_worlds, np.bool_), np.zeros((num_worlds, 2), np.int64),
            values[0], values[1], np.zeros(count, np.float32), terminals, truncations, arrivals, masks,
            np.zeros((count, len(NUMBERS))),
        )  # fmt: skip


@kernel(allocates=False)
def list_ends(is_over: Bool, ended: Int64, playing: Int64, slots: Int64, ends: Int64) -> int:
    """List the worlds in which no agent is left or due.

    Args:
        is_over, ended: (W,), (W, 2) see ``Seats``.
        playing: (W,) scenario of each world.
        slots: (W,) output: the worlds.
        ends: (3, W) output: scenario, number of agents of the episode, and of those that arrived.

    Returns:
        Number of the worlds.
    """
    count = 0
    for w in range(len(is_over)):
        if is_over[w]:
            slots[count] = w
            ends[0, count], ends[1, count], ends[2, count] = playing[w], ended[w, 0], ended[w, 1]
            count += 1
    return count


@device_function
def seat_agents(w: int, seats: Seats, agents: DrivenArrays) -> None:
    """Give rows to the agents of a world that begins an episode."""
    count = len(seats.masks) // len(seats.is_over)
    seats.ended[w, 0], seats.ended[w, 1] = 0, 0
    for k in range(count):
        row = w * count + k
        seats.masks[row] = k < agents.rows.shape[1] and agents.rows[w, k] >= 0
        _clear(seats.observations[row])


@device_function
def settle(
    w: int,
    recorded: Recorded,
    before: StateArrays,
    now: StateArrays,
    driver: UInt8,
    agents: DrivenArrays,
    result: StepResult,
    seats: Seats,
) -> None:
    """Write the results of a step to the rows of a world's agents; those that ended leave, unless all have ended."""
    num_seats, num_places = len(seats.masks) // len(seats.is_over), agents.rows.shape[1]
    for row in range(w * num_seats, (w + 1) * num_seats):
        seats.rewards[row] = 0.0
        seats.terminals[row] = seats.truncations[row] = seats.arrivals[row] = False
    num_agents, num_ended = 0, 0
    for k in range(num_places):
        if agents.rows[w, k] < 0:
            continue
        num_agents += 1
        a, row = w * num_places + k, w * num_seats + k
        status = result.status[a]
        if k < num_seats:
            seats.rewards[row], seats.masks[row] = result.rewards[a], True
        if status == DRIVING or not seats.can_end[w]:
            continue
        num_ended += 1
        seats.ended[w, 0] += 1
        seats.ended[w, 1] += status == ARRIVED
        if k < num_seats:
            seats.truncations[row], seats.terminals[row] = status == TIMED_OUT, status != TIMED_OUT
            seats.arrivals[row], seats.masks[row] = status == ARRIVED, False
            for column in range(len(result.numbers)):
                seats.last_numbers[row, column] = result.numbers[column, a]
            for column in range(seats.observations.shape[1]):
                seats.last_observations[row, column] = seats.observations[row, column]
            _clear(seats.observations[row])
    is_left = num_ended < num_agents or not seats.can_end[w]
    seats.is_over[w] = not is_left and not is_agent_due(w, recorded, now, driver, agents)
    if seats.is_over[w] or num_ended == 0:
        return
    for k in range(num_places):
        n = agents.rows[w, k]
        if n >= 0 and result.status[w * num_places + k] != DRIVING:
            agents.rows[w, k], driver[w, n] = -1, UNDRIVEN
            before.present[w, n], now.present[w, n] = False, False


@device_function
def _clear(values: Float32) -> None:
    for k in range(len(values)):
        values[k] = 0.0
