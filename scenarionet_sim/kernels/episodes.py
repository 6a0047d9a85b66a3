"""The beginning of episodes: the state of a world at a timestep of its log, and the agents of worlds."""

from __future__ import annotations

import numpy as np

from scenarionet_data.arrays.compiled import device_function, kernel
from scenarionet_data.arrays.dtypes import Bool, Int32, Int64, UInt8
from scenarionet_sim.kernels.log import VALID
from scenarionet_sim.kernels.structures import (
    FIRST_AGENTS,
    FIRST_STEP,
    LATER_AGENTS,
    LOG,
    NUM_OBJECTS,
    OBJECTS,
    Recorded,
    StateArrays,
)

UNDRIVEN = 255
"""A policy number: a row that no policy drives and that is never present."""


@device_function
def begin_world(w: int, at: int, recorded: Recorded, now: StateArrays, then: StateArrays, driver: UInt8) -> None:
    """Set a world to a timestep of its log, in the current and in the next state, which share sizes and types.

    Args:
        w: The world.
        at: The timestep.
        recorded: Logs of W worlds.
        now, then: The two states.
        driver: (W, N) policy of each object, written.
    """
    count, objects = recorded.place[w, NUM_OBJECTS], recorded.place[w, OBJECTS]
    first = recorded.place[w, LOG] + at * count
    now.timestep[w], then.timestep[w] = at, at
    for n in range(driver.shape[1]):
        driver[w, n] = recorded.driver[objects + n] if n < count else UNDRIVEN
        is_present = driver[w, n] != UNDRIVEN and recorded.log[first + n, VALID] != 0.0
        now.present[w, n], then.present[w, n] = is_present, is_present
    for n in range(count):
        now.route[w, n, 0], now.route[w, n, 1] = np.nan, 0.0
        then.route[w, n, 0], then.route[w, n, 1] = np.nan, 0.0
        then.object_type[w, n] = recorded.object_type[objects + n]
        for axis in range(3):
            then.size[w, n, axis] = recorded.size[objects + n, axis]
        if then.present[w, n]:
            for column in range(VALID):
                value = recorded.log[first + n, column]
                now.motion[w, n, column], then.motion[w, n, column] = value, value


@kernel(allocates=False)
def schedule(slots: Int64, at: int, place: Int64, first: Int32, begins: Int32, awaits: Bool) -> tuple[bool, bool]:
    """Let episodes begin in the next step.

    Args:
        slots: (B,) their worlds.
        at: Timestep of the logs; -1 for the first one with a valid ego.
        place: (W, NUM_PLACES) see ``Recorded``.
        first: (W + 1,) first agent of each world, of the episodes before.
        begins: (W,) see ``StepArrays``; written.
        awaits: (W,) worlds in which an agent is absent that may still appear; written if ``at`` is -1.

    Returns:
        Whether all slots will have as many agents as before, which is known if ``at`` is -1; whether an agent of any
        world is absent then.
    """
    is_same, is_due = at < 0, False
    for b in range(len(slots)):
        w = slots[b]
        begins[w] = place[w, FIRST_STEP] if at < 0 else at
        is_same &= place[w, FIRST_AGENTS] == first[w + 1] - first[w]
        if at < 0:
            awaits[w] = place[w, LATER_AGENTS] > 0
    for w in range(len(awaits)):
        is_due |= awaits[w]
    return is_same, is_due


@kernel(allocates=False)
def list_agents(
    place: Int64, driver: UInt8, present: Bool, is_agent: Bool, known: Int32, rows: Int32, first: Int32, awaits: Bool
) -> tuple[bool, bool]:
    """List the present agents.

    Args:
        place: (W, NUM_PLACES) see ``Recorded``.
        driver, present: (W, N) policy of each object, and whether it is present.
        is_agent: (256,) policies of agents.
        known: (A, 2) agents as listed last.
        rows: (W * N, 2) output: world and row of each agent.
        first: (W + 1,) first agent of each world as listed last; output.
        awaits: (W,) output: worlds in which another agent is still absent.

    Returns:
        Whether another object is an agent than before; whether a world has another number of agents than before.
    """
    count, is_other, is_resized = 0, False, False
    for w in range(driver.shape[0]):
        is_resized |= first[w] != count
        first[w], awaits[w] = count, False
        for n in range(place[w, NUM_OBJECTS]):
            if not is_agent[driver[w, n]]:
                continue
            if not present[w, n]:
                awaits[w] = True
                continue
            rows[count, 0], rows[count, 1] = w, n
            is_other |= count >= len(known) or known[count, 0] != w or known[count, 1] != n
            count += 1
    is_resized |= first[driver.shape[0]] != count
    first[driver.shape[0]] = count
    return is_other or count != len(known), is_resized


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
