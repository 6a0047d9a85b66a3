"""The beginning of episodes: the state of worlds at a timestep of their logs, and their agents."""

from __future__ import annotations

import numpy as np

from scenarionet_data.arrays.compiled import device_function, kernel
from scenarionet_data.arrays.dtypes import Bool, Int32, Int64, UInt8
from scenarionet_sim.kernels.log import VALID
from scenarionet_sim.kernels.structures import FIRST_STEP, LOG, NUM_OBJECTS, OBJECTS, Recorded, StateArrays

UNDRIVEN = 255
"""A policy number: a row that no policy drives and that is never present."""


@kernel(allocates=False)
def begin_worlds(
    slots: Int32,
    at: int,
    recorded: Recorded,
    now: StateArrays,
    then: StateArrays,
    driver: UInt8,
    has_begun: Bool,
) -> None:
    """Set slots to a timestep of the logs of their worlds, in the current and in the next state.

    Args:
        slots: (B,) the slots.
        at: The timestep; -1 for the first at which the ego is valid.
        recorded: Logs of W worlds.
        now, then: The two states.
        driver: (W, N) policy of each object, written.
        has_begun: (W,) set to True in the slots.
    """
    for b in range(len(slots)):
        w = slots[b]
        has_begun[w] = True
        count, objects = recorded.place[w, NUM_OBJECTS], recorded.place[w, OBJECTS]
        start = recorded.place[w, FIRST_STEP] if at < 0 else at
        now.timestep[w], then.timestep[w] = start, start
        for n in range(driver.shape[1]):
            driver[w, n] = recorded.driver[objects + n] if n < count else UNDRIVEN
            now.present[w, n], now.route[w, n, 0], now.route[w, n, 1] = False, np.nan, 0.0
            if n < count:
                row = recorded.log[recorded.place[w, LOG] + start * count + n]
                now.present[w, n] = row[VALID] != 0.0 and driver[w, n] != UNDRIVEN
                for column in range(now.motion.shape[2]):
                    now.motion[w, n, column] = row[column]
                for axis in range(3):
                    now.size[w, n, axis] = recorded.size[objects + n, axis]
                now.object_type[w, n] = recorded.object_type[objects + n]
        copy_world(w, driver.shape[1], now, then)


@kernel(allocates=False)
def list_agents(
    place: Int64, driver: UInt8, present: Bool, is_agent: Bool, known: Int32, rows: Int32, first: Int32
) -> tuple[bool, bool, bool]:
    """List the present agents.

    Args:
        place: (W, NUM_PLACES) see ``Recorded``.
        driver, present: (W, N) policy of each object, and whether it is present.
        is_agent: (256,) policies of agents.
        known: (A, 2) agents as listed last.
        rows: (W * N, 2) output: world and row of each agent.
        first: (W + 1,) first agent of each world as listed last; output.

    Returns:
        Whether another agent is still absent; whether another object is an agent than before; whether a world has
        another number of agents than before.
    """
    count, is_due, is_other, is_resized = 0, False, False, False
    for w in range(driver.shape[0]):
        is_resized |= first[w] != count
        first[w] = count
        for n in range(place[w, NUM_OBJECTS]):
            if not is_agent[driver[w, n]]:
                continue
            if not present[w, n]:
                is_due = True
                continue
            rows[count, 0], rows[count, 1] = w, n
            is_other |= count >= len(known) or known[count, 0] != w or known[count, 1] != n
            count += 1
    is_resized |= first[driver.shape[0]] != count
    first[driver.shape[0]] = count
    return is_due, is_other or count != len(known), is_resized


@kernel(allocates=False)
def place_among(rows: Int32, others: Int32, place: Int32) -> None:
    """Find agents in another list of agents.

    Args:
        rows: (A, 2) world and row of each agent, sorted.
        others: (B, 2) the other list, sorted.
        place: (A,) output: index in the other list; -1 if it is not there.
    """
    b = 0
    for a in range(len(rows)):
        while b < len(others) and (
            others[b, 0] < rows[a, 0] or (others[b, 0] == rows[a, 0] and others[b, 1] < rows[a, 1])
        ):
            b += 1
        is_there = b < len(others) and others[b, 0] == rows[a, 0] and others[b, 1] == rows[a, 1]
        place[a] = b if is_there else -1


@device_function
def copy_world(w: int, count: int, source: StateArrays, target: StateArrays) -> None:
    """Copy presence and routes of the objects of a world, and the motion of those that are present."""
    for n in range(count):
        target.present[w, n] = source.present[w, n]
        target.route[w, n, 0], target.route[w, n, 1] = source.route[w, n, 0], source.route[w, n, 1]
        if source.present[w, n]:
            for column in range(VALID):
                target.motion[w, n, column] = source.motion[w, n, column]
