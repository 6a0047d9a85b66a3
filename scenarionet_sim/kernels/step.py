"""One step of a simulation, world by world: traffic, agents, contacts, scores and observations.

A world's step reads and writes rows of that world only, so threads can share worlds out, with the same result.
"""

from __future__ import annotations

import numpy as np

from scenarionet_data.arrays.compiled import device_function, kernel
from scenarionet_data.arrays.dtypes import Float64
from scenarionet_sim.kernels.bicycle import drive_bicycle
from scenarionet_sim.kernels.boxes import write_boxes
from scenarionet_sim.kernels.episodes import begin_world
from scenarionet_sim.kernels.idm import Law, drive_along_paths
from scenarionet_sim.kernels.minmax import larger
from scenarionet_sim.kernels.motion import FOLLOW_PATH, move_objects
from scenarionet_sim.kernels.observation import Scratch, observe
from scenarionet_sim.kernels.overlap import touch
from scenarionet_sim.kernels.paths import PathRows, locate
from scenarionet_sim.kernels.scoring import StepResult, score
from scenarionet_sim.kernels.sharing import LEADER, Team, begin, end, keep, kept, take
from scenarionet_sim.kernels.step_arrays import BEGUN, GOES_ON, DrivenArrays, StepArrays
from scenarionet_sim.kernels.strip import SightMemory
from scenarionet_sim.kernels.structures import (
    DRIVERS,
    EGO,
    NUM_OBJECTS,
    OBJECTS,
    Recorded,
    StateArrays,
)

MOVE, DRIVE, LOCATE, SCORE, OBSERVE, ONLY_BEGUN = (1 << bit for bit in range(6))
"""Phases of a step, in order: traffic moves; agents drive by their actions; they are located and their contacts found;
scored; observed. Episodes begin before. ``ONLY_BEGUN``: in worlds that have just begun an episode alone."""


@kernel(nogil=True, allocates=False)
def step_worlds(
    own: int,
    team: Team,
    phases: int,
    substeps: int,
    numbers: tuple[float, float, float, float],
    arrays: StepArrays,
    scratch: Scratch,
) -> None:
    """Advance worlds by one step; the largest result of any thread is an agent that is not located on its path, or -1.

    Args:
        own: Number of the thread.
        team: Threads that share the worlds; all but the leader's arguments are taken from the leader.
        phases: Phases of the step.
        substeps: Substeps of the vehicle model.
        numbers: Length of the step [s]; search window on a path behind and ahead of an agent [m]; 1 if the routes
            of the agents are those of the state, 0 if they have a location of their own.
        arrays: What the step reads and writes.
        scratch: Memory of this thread.
    """
    if own == LEADER:
        keep(team, (phases, substeps, numbers, arrays))
    turn = begin(team, own, 0)
    while turn:
        given = kept(team, (phases, substeps, numbers, arrays))
        lost, w = -1, take(team.ranges, own)
        while w >= 0:
            _begin_or_move(w, given[0], given[2], given[3])
            lost = larger(lost, _finish(w, given[0], given[1], given[2], given[3], scratch))
            w = take(team.ranges, own)
        turn = end(team, own, turn, lost)


@kernel(nogil=True, allocates=False)
def step_reactive_worlds(
    own: int,
    team: Team,
    phases: int,
    substeps: int,
    numbers: tuple[float, float, float, float],
    arrays: StepArrays,
    scratch: Scratch,
    memory: SightMemory,
) -> None:
    """Advance worlds in which objects follow paths by IDM: a kernel of its own, as replays need not compile that.

    Args:
        own, team, phases, substeps, numbers, arrays, scratch: See :func:`step_worlds`.
        memory: Memory of this thread.
    """
    if own == LEADER:
        keep(team, (phases, substeps, numbers, arrays))
    turn = begin(team, own, 0)
    while turn:
        given = kept(team, (phases, substeps, numbers, arrays))
        lost, w = -1, take(team.ranges, own)
        while w >= 0:
            _begin_or_move(w, given[0], given[2], given[3])
            _drive_by_idm(w, given[0], given[2][0], given[3], memory)
            lost = larger(lost, _finish(w, given[0], given[1], given[2], given[3], scratch))
            w = take(team.ranges, own)
        turn = end(team, own, turn, lost)


@device_function(forceinline=True)
def _finish(
    w: int,
    phases: int,
    substeps: int,
    numbers: tuple[float, float, float, float],
    arrays: StepArrays,
    scratch: Scratch,
) -> int:
    """Run the phases after the traffic's in a world; return an agent that is not located on its path, or -1."""
    dt, back, ahead, is_own = numbers
    agents, recorded, then, result = arrays.agents, arrays.recorded, arrays.then, arrays.result
    a0, a1, has_begun, lost = agents.first[w], agents.first[w + 1], arrays.begins[w] == BEGUN, -1
    if phases & ONLY_BEGUN and not has_begun:
        return lost
    if phases & DRIVE and not has_begun:
        for a in range(a0, a1):
            n, action = agents.rows[a, 1], agents.actions[a]
            vehicle, row = arrays.vehicles[w, n], then.motion[w, n]
            drive_bicycle(action[0], action[1], dt, substeps, vehicle, then.size[w, n, 0], row)
    num_boxes = 0
    if phases & (LOCATE | OBSERVE) and a1 > a0:
        count = recorded.place[w, NUM_OBJECTS]
        num_boxes = write_boxes(count, then.motion[w], then.size[w], then.present[w], scratch.boxes)
    if phases & LOCATE:
        for a in range(a0, a1):
            n = agents.rows[a, 1]
            _locate(w, n, back, ahead, is_own != 0.0, recorded, then, agents)
            _find_contacts(a, w, n, num_boxes, then, agents, scratch)
    if phases & SCORE:
        if has_begun:
            _clear_scores(w, a0, a1, is_own != 0.0, arrays)
        else:
            for a in range(a0, a1):
                _score(a, w, agents.rows[a, 1], recorded, then, agents, arrays.task, result)
    if phases & OBSERVE:
        for a in range(a0, a1):
            n = agents.rows[a, 1]
            if np.isnan(agents.route[w, n, 0]):
                lost = a
            observe(a, w, n, num_boxes, recorded, arrays.lines, then, agents.route, arrays.sensing, scratch)
    return lost


@device_function(forceinline=True)
def _drive_by_idm(w: int, phases: int, dt: float, arrays: StepArrays, memory: SightMemory) -> None:
    """Write the next state of objects that follow paths by IDM."""
    if not phases & MOVE or arrays.begins[w] == BEGUN:
        return
    recorded, traffic = arrays.recorded, arrays.traffic
    for policy in range(len(traffic.movement)):
        if traffic.movement[policy] == FOLLOW_PATH and recorded.place[w, DRIVERS] >> policy & 1:
            row = traffic.law[w, policy]
            law = Law(row[0], row[1], row[2], row[3], row[4], row[5], row[6], row[7])
            drive_along_paths(
                w, recorded, arrays.now, arrays.then, traffic.driver, policy, dt, law, traffic.colors, memory
            )


@device_function(forceinline=True)
def _begin_or_move(w: int, phases: int, numbers: tuple[float, float, float, float], arrays: StepArrays) -> None:
    """Begin an episode, or write the next state of all objects, which is the current one of those that IDM drives."""
    recorded, now, then, traffic = arrays.recorded, arrays.now, arrays.then, arrays.traffic
    if arrays.begins[w] >= 0:
        begin_world(w, arrays.begins[w], recorded, now, then, traffic.driver)
        _begin_agents(w, numbers[3] != 0.0, arrays)
        arrays.begins[w] = BEGUN
    elif phases & MOVE and arrays.begins[w] == GOES_ON:
        move_objects(w, recorded, now, then, traffic.driver, traffic.movement, numbers[0])


@device_function(forceinline=True)
def _begin_agents(w: int, is_own: bool, arrays: StepArrays) -> None:
    """Give the agents of a world new vehicles, and list those that are present: as many as the world had before."""
    agents, a = arrays.agents, arrays.agents.first[w]
    for n in range(arrays.recorded.place[w, NUM_OBJECTS]):
        if not _is_agent(w, n, is_own, arrays):
            continue
        for column in range(len(arrays.new_vehicle)):
            arrays.vehicles[w, n, column] = arrays.new_vehicle[column]
        if not is_own:
            agents.route[w, n, 0], agents.route[w, n, 1] = np.nan, np.nan
        if arrays.then.present[w, n] and a < agents.first[w + 1]:
            agents.rows[a, 1] = n
            a += 1


@device_function(forceinline=True)
def _is_agent(w: int, n: int, is_own: bool, arrays: StepArrays) -> bool:
    """Return whether an object is an agent, present or not."""
    is_agent: bool = (
        arrays.agents.is_agent[arrays.traffic.driver[w, n]] if is_own else n == arrays.recorded.place[w, EGO]
    )
    return is_agent


@device_function(forceinline=True)
def _locate(
    w: int,
    n: int,
    back: float,
    ahead: float,
    is_own: bool,
    recorded: Recorded,
    then: StateArrays,
    agents: DrivenArrays,
) -> None:
    """Locate an agent on its path."""
    route = agents.route[w, n]
    if not is_own:
        agents.route_before[w, n, 0], agents.route_before[w, n, 1] = route[0], route[1]
    row = recorded.place[w, OBJECTS] + n
    path = PathRows(recorded.path, recorded.path_offsets[row], recorded.path_offsets[row + 1])
    locate(path, back, ahead, then.motion[w, n], route, is_own)


@device_function(forceinline=True)
def _find_contacts(
    a: int, w: int, n: int, num_boxes: int, then: StateArrays, agents: DrivenArrays, scratch: Scratch
) -> None:
    """Find what an agent touches: nothing if it is absent."""
    contacts, agents.hits[a] = agents.contacts[a], 0
    for m in range(len(contacts)):
        contacts[m] = False
    if then.present[w, n]:
        motion, size, object_type = then.motion[w], then.size[w], then.object_type[w]
        agents.hits[a] = touch(n, motion, size, object_type, scratch.boxes, num_boxes, contacts)


@device_function(forceinline=True)
def _clear_scores(w: int, first: int, end: int, is_own: bool, arrays: StepArrays) -> None:
    """Clear the scores of the agents of a world; contacts at the beginning do not count as crashes."""
    agents, result = arrays.agents, arrays.result
    for n in range(arrays.recorded.place[w, NUM_OBJECTS]):
        if _is_agent(w, n, is_own, arrays):
            for column in range(result.totals.shape[2]):
                result.totals[w, n, column] = 0.0
    for a in range(first, end):
        for column in range(result.numbers.shape[1]):
            result.numbers[a, column] = 0.0
        result.status[a] = 0
        for m in range(agents.contacts.shape[1]):
            agents.contacts_before[a, m] = agents.contacts[a, m]


@device_function(forceinline=True)
def _score(
    a: int,
    w: int,
    n: int,
    recorded: Recorded,
    then: StateArrays,
    agents: DrivenArrays,
    task: Float64,
    result: StepResult,
) -> None:
    """Score an agent, and remember its contacts."""
    contacts, before, steering = agents.contacts[a], agents.contacts_before[a], agents.actions[a, 0]
    touched, route, route_before = (contacts, before, agents.hits[a]), agents.route[w, n], agents.route_before[w, n]
    score(a, w, n, steering, touched, then, route, route_before, recorded, task, result)
    for m in range(len(contacts)):
        before[m] = contacts[m]
