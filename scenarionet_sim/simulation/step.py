"""One step of a simulation, world by world: traffic, agents, contacts, scores and observations.

A world's step reads and writes rows of that world only, so threads can share worlds out, with the same result.
"""

from __future__ import annotations

import numpy as np

from scenarionet_data.compiled.decorators import device_function, kernel
from scenarionet_sim.arrays.boxes import write_boxes
from scenarionet_sim.arrays.minmax import larger, smaller
from scenarionet_sim.arrays.overlap import touch
from scenarionet_sim.arrays.structures import (
    DRIVERS,
    FIRST_STEP,
    NUM_OBJECTS,
    OBJECTS,
    StateArrays,
)
from scenarionet_sim.backends.bicycle_kernels import GRIP, drive_bicycle
from scenarionet_sim.policies.idm_kernels import drive_along_paths
from scenarionet_sim.policies.motion_kernels import FOLLOW_PATH, move_objects
from scenarionet_sim.policies.strip_kernels import SightMemory
from scenarionet_sim.sensors.observation_kernels import Scratch, observe
from scenarionet_sim.simulation.agent_kernels import DrivenArrays, admit_agents, is_agent_of, list_agents
from scenarionet_sim.simulation.recording import record_moment
from scenarionet_sim.simulation.seats import seat_agents, settle
from scenarionet_sim.simulation.step_arrays import Exchange, StepArrays, StepSettings
from scenarionet_sim.task.scoring_kernels import clear_score, excuse, score
from scenarionet_sim.threads.sharing import LEADER, Team, begin, end, keep, kept, take
from scenarionet_sim.worlds.episode_kernels import AT_FIRST, BEGUN, GOES_ON, begin_world
from scenarionet_sim.worlds.path_kernels import PathRows, locate

MOVE, DRIVE, LOCATE, SCORE, OBSERVE, SETTLE, GO_ON, ONLY_BEGUN, RECORD = (1 << bit for bit in range(9))
"""Phases of a step, in order: traffic moves; agents drive by their actions; those that have appeared get places, and
all are located and their contacts found; scored; observed; those that ended leave; episodes that have
begun go on. Episodes begin before.
``ONLY_BEGUN``: in worlds that have just begun an episode alone.
``RECORD``: step after step of each world, until its recorded episode is over or has no room for another moment."""


@kernel(nogil=True, allocates=False)
def step_worlds(
    own: int,
    team: Team,
    phases: int,
    settings: StepSettings,
    arrays: StepArrays,
    exchange: Exchange,
    scratch: Scratch,
) -> None:
    """Advance worlds by one step; the largest result of any thread is an agent that is not located on its path, or -1.

    Args:
        own: Number of the thread.
        team: Threads that share the worlds; all but the leader's arguments are taken from the leader.
        phases: Phases of the step.
        settings: What is the same in all worlds.
        arrays: What steps read and write.
        exchange: What the step gets and returns.
        scratch: Memory of this thread.
    """
    _step(own, team, phases, settings, arrays, exchange, scratch, None)


@kernel(nogil=True, allocates=False)
def step_reactive_worlds(
    own: int,
    team: Team,
    phases: int,
    settings: StepSettings,
    arrays: StepArrays,
    exchange: Exchange,
    scratch: Scratch,
    memory: SightMemory,
) -> None:
    """Advance worlds in which objects follow paths by IDM: a kernel of its own, as replays need not compile that.

    Args:
        own, team, phases, settings, arrays, exchange, scratch: See :func:`step_worlds`.
        memory: Memory of this thread.
    """
    _step(own, team, phases, settings, arrays, exchange, scratch, memory)


@device_function(forceinline=True, nogil=True)
def _step(
    own: int, team: Team, phases: int, settings: StepSettings, arrays: StepArrays, exchange: Exchange, scratch: Scratch,
    memory: SightMemory | None,
) -> None:  # fmt: skip
    """Advance worlds by one step; without a memory none of their objects follows a path."""
    if own == LEADER:
        keep(team, (phases, settings, arrays, exchange))
    turn = begin(team, own, 0)
    while turn:
        given = kept(team, (phases, settings, arrays, exchange))
        lost, w = -1, take(team.ranges, own)
        while w >= 0:
            goes_on = True
            while goes_on:
                _begin_or_move(w, given[0], given[1], given[2])
                if memory is not None:
                    _drive_by_idm(w, given[0], given[1].dt, given[2], memory)
                lost = larger(lost, _finish(w, given[0], given[1], given[2], given[3], scratch))
                goes_on = given[0] & RECORD != 0 and _record(w, given[2], given[3])
            w = take(team.ranges, own)
        turn = end(team, own, turn, lost)


@device_function
def _record(w: int, arrays: StepArrays, exchange: Exchange) -> bool:
    """Record a world, unless its episode is over; return whether another step follows, from the state after this."""
    now, then, agents, episodes = arrays.now, arrays.then, arrays.agents, exchange.episodes
    if episodes.is_over[w]:
        return False
    record_moment(w, arrays.recorded.place, then, agents.route, agents.contacts, exchange.result, episodes)
    if episodes.is_over[w] or episodes.last[w] + 1 == episodes.arc.shape[1]:
        return False
    now.timestep[w] = then.timestep[w]
    for n in range(arrays.recorded.place[w, NUM_OBJECTS]):
        now.present[w, n] = then.present[w, n]
        now.route[w, n, 0], now.route[w, n, 1] = then.route[w, n, 0], then.route[w, n, 1]
        for column in range(now.motion.shape[2]):
            now.motion[w, n, column] = then.motion[w, n, column]
    return True


@device_function(forceinline=True)
def _finish(
    w: int,
    phases: int,
    settings: StepSettings,
    arrays: StepArrays,
    exchange: Exchange,
    scratch: Scratch,
) -> int:
    """Run the phases after the traffic's in a world; return an agent that is not located on its path, or -1."""
    dt, is_own, num_observed = settings.dt, settings.are_own_routes, settings.num_observed
    agents, recorded, then, result = arrays.agents, arrays.recorded, arrays.then, exchange.result
    has_begun, lost, num_places = arrays.begins[w] == BEGUN, -1, agents.rows.shape[1]
    if phases & ONLY_BEGUN and not has_begun:
        return lost
    first = w * num_places
    if phases & DRIVE and not has_begun:
        for k in range(num_places):
            n = agents.rows[w, k]
            if n >= 0:
                vehicle, row, action = arrays.vehicles[w, n], then.motion[w, n], exchange.actions[first + k]
                drive_bicycle(action[0], action[1], dt, settings.substeps, vehicle, then.size[w, n, 0], row)
    if phases & LOCATE and not has_begun:
        admit_agents(w, recorded, arrays.now, then, arrays.traffic.driver, agents)
    has_agents = False
    for k in range(num_places):
        has_agents |= agents.rows[w, k] >= 0
    if phases & (LOCATE | OBSERVE) and has_agents:
        count = recorded.place[w, NUM_OBJECTS]
        write_boxes(count, then.motion[w], then.size[w], then.present[w], scratch.boxes)
    if phases & LOCATE:
        for k in range(num_places):
            n = agents.rows[w, k]
            if n >= 0:
                route, objects = agents.route[w, n], recorded.place[w, OBJECTS] + n
                if not is_own:
                    agents.route_before[w, n, 0], agents.route_before[w, n, 1] = route[0], route[1]
                path = PathRows(recorded.path, recorded.path_offsets[objects], recorded.path_offsets[objects + 1])
                locate(path, settings.back, settings.ahead, then.motion[w, n], route, is_own)
                contacts, agents.hits[first + k] = agents.contacts[first + k], 0
                for m in range(len(contacts)):
                    contacts[m] = False
                if then.present[w, n]:
                    of_world = then.motion[w], then.size[w], then.object_type[w]
                    agents.hits[first + k] = touch(n, of_world, scratch.boxes, contacts)
                if has_begun or agents.is_new[w, k]:  # what it touches from the beginning is no crash
                    _remember_contacts(first + k, agents)
    if phases & SCORE:
        if has_begun:
            for n in range(recorded.place[w, NUM_OBJECTS]):
                if is_agent_of(w, n, not is_own, recorded, arrays.traffic.driver, agents):
                    for column in range(arrays.totals.shape[2]):
                        arrays.totals[w, n, column] = 0.0
        for k in range(num_places):
            n, result.timestep[first + k] = agents.rows[w, k], then.timestep[w]
            if n >= 0 and has_begun:
                clear_score(first + k, result)
            elif n >= 0:
                a, steering = first + k, exchange.actions[first + k, 0]  # 0 at a place that was free
                touched = agents.contacts[a], agents.contacts_before[a], agents.hits[a]
                routes = agents.route[w, n], agents.route_before[w, n]
                score(a, w, n, steering, touched, routes, then, recorded, arrays.task, arrays.totals, result)
                _remember_contacts(a, agents)
                if agents.is_new[w, k]:
                    excuse(first + k, result)
    if phases & OBSERVE:
        seen = StateArrays(then.motion, agents.route, then.present, then.size, then.object_type, then.timestep)
        for k in range(smaller(num_places, num_observed)):
            n = agents.rows[w, k]
            if n < 0:
                continue
            if np.isnan(agents.route[w, n, 0]):
                lost = first + k
            at = w * num_observed + k
            observe(at, w, n, recorded, arrays.lines, seen, exchange.sensing, scratch)
    if phases & SETTLE:
        settle(w, recorded, arrays.now, then, arrays.traffic.driver, agents, result, arrays.seats)
    if phases & GO_ON:
        arrays.begins[w] = GOES_ON
    return lost


@device_function(forceinline=True)
def _drive_by_idm(w: int, phases: int, dt: float, arrays: StepArrays, memory: SightMemory) -> None:
    """Write the next state of objects that follow paths by IDM."""
    if not phases & MOVE or arrays.begins[w] == BEGUN:
        return
    recorded, traffic = arrays.recorded, arrays.traffic
    for policy in range(len(traffic.movement)):
        if traffic.movement[policy] == FOLLOW_PATH and recorded.place[w, DRIVERS] >> policy & 1:
            drive_along_paths(w, policy, dt, recorded, arrays.now, arrays.then, traffic, memory)


@device_function(forceinline=True)
def _begin_or_move(w: int, phases: int, settings: StepSettings, arrays: StepArrays) -> None:
    """Begin an episode, or write the next state of all objects, which is the current one of those that IDM drives."""
    recorded, now, then, traffic, at = arrays.recorded, arrays.now, arrays.then, arrays.traffic, arrays.begins[w]
    if at >= 0 or at == AT_FIRST:
        start = at if at >= 0 else recorded.place[w, FIRST_STEP]
        begin_world(w, start, recorded, now, then, traffic.driver)
        _begin_agents(w, not settings.are_own_routes, arrays)
        arrays.begins[w] = BEGUN
    elif phases & MOVE and at == GOES_ON:
        move_objects(w, recorded, now, then, traffic.driver, traffic.movement, settings.dt)


@device_function(forceinline=True)
def _begin_agents(w: int, are_egos: bool, arrays: StepArrays) -> None:
    """Give the agents of a world places, rows of flat buffers and new vehicles."""
    agents, driver = arrays.agents, arrays.traffic.driver
    list_agents(w, are_egos, arrays.recorded, arrays.then, driver, agents)
    seat_agents(w, arrays.seats, agents)
    for n in range(arrays.recorded.place[w, NUM_OBJECTS]):
        if is_agent_of(w, n, are_egos, arrays.recorded, driver, agents):
            for column in range(len(arrays.new_vehicle)):
                arrays.vehicles[w, n, column] = arrays.new_vehicle[column]
            if len(arrays.new_vehicle):
                row = arrays.recorded.place[w, OBJECTS] + n
                arrays.vehicles[w, n, GRIP] = arrays.new_vehicle[GRIP] * arrays.recorded.friction[row]
            if are_egos:
                agents.route[w, n, 0], agents.route[w, n, 1] = np.nan, np.nan


@device_function(forceinline=True)
def _remember_contacts(a: int, agents: DrivenArrays) -> None:
    """Keep what an agent touches for the next step."""
    for m in range(agents.contacts.shape[1]):
        agents.contacts_before[a, m] = agents.contacts[a, m]
