"""The agents of worlds: each has a place in its world from its appearance until it leaves."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from scenarionet_data.arrays.dtypes import Bool, Float64, Int32, UInt8
from scenarionet_data.compiled.decorators import device_function
from scenarionet_sim.arrays.log import VALID
from scenarionet_sim.arrays.structures import EGO, LOG, NUM_OBJECTS, NUM_STEPS, Recorded, StateArrays


class DrivenArrays(NamedTuple):
    """Agents of W worlds with K places each: place k of world w is number ``w * K + k`` of C = W * K.

    Attributes:
        is_agent: (256,) policies whose objects are agents.
        rows: (W, K) row of the agent at each place in its world; -1 at a free place.
        is_new: (W, K) agents that have appeared in this step.
        awaits: (W,) worlds in which an agent is absent that may still appear.
        route, route_before: (W, N, 2) location on their paths, see ``State``; after the step, and before it.
        contacts, contacts_before: (C, N) objects that they touch.
        hits: (C,) types of those objects, as bits.
    """

    is_agent: Bool
    rows: Int32
    is_new: Bool
    awaits: Bool
    route: Float64
    route_before: Float64
    contacts: Bool
    contacts_before: Bool
    hits: npt.NDArray[np.uint32]


@device_function(forceinline=True)
def is_agent_of(w: int, n: int, are_egos: bool, recorded: Recorded, driver: UInt8, agents: DrivenArrays) -> bool:
    """Return whether an object is an agent, present or not: that of an agent's policy, or the ego."""
    is_agent: bool = n == recorded.place[w, EGO] if are_egos else agents.is_agent[driver[w, n]]
    return is_agent


@device_function
def list_agents(
    w: int, are_egos: bool, recorded: Recorded, now: StateArrays, driver: UInt8, agents: DrivenArrays
) -> None:
    """Give places to the agents of a world that begins an episode; egos are agents even if they are absent."""
    k, agents.awaits[w] = 0, False
    for n in range(recorded.place[w, NUM_OBJECTS]):
        if not is_agent_of(w, n, are_egos, recorded, driver, agents):
            continue
        if are_egos or now.present[w, n]:
            agents.rows[w, k], agents.is_new[w, k] = n, False
            k += 1
        else:
            agents.awaits[w] = True
    for free in range(k, agents.rows.shape[1]):
        agents.rows[w, free], agents.is_new[w, free] = -1, False


@device_function
def admit_agents(
    w: int, recorded: Recorded, before: StateArrays, now: StateArrays, driver: UInt8, agents: DrivenArrays
) -> None:
    """Give the first free places of a world to agents that have appeared in this step."""
    for k in range(agents.rows.shape[1]):
        agents.is_new[w, k] = False
    if not agents.awaits[w]:
        return
    k, agents.awaits[w] = 0, False
    for n in range(recorded.place[w, NUM_OBJECTS]):
        if not agents.is_agent[driver[w, n]]:
            continue
        if not now.present[w, n]:
            agents.awaits[w] = True
        elif not before.present[w, n]:
            while agents.rows[w, k] >= 0:
                k += 1
            agents.rows[w, k], agents.is_new[w, k] = n, True


@device_function
def is_agent_due(w: int, recorded: Recorded, now: StateArrays, driver: UInt8, agents: DrivenArrays) -> bool:
    """Return whether an absent agent of a world appears later in the log."""
    if not agents.awaits[w]:
        return False
    count, first = recorded.place[w, NUM_OBJECTS], recorded.place[w, LOG]
    for n in range(count):
        if agents.is_agent[driver[w, n]] and not now.present[w, n]:
            for t in range(now.timestep[w] + 1, recorded.place[w, NUM_STEPS]):
                if recorded.log[first + t * count + n, VALID] != 0.0:
                    return True
    return False
