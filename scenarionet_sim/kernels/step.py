"""One step of a simulation, world by world: traffic, agents, contacts, scores and observations.

A world's step reads and writes rows of that world only, so ranges of worlds can run in threads, with the same result.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from scenarionet_data.arrays.compiled import device_function, kernel
from scenarionet_data.arrays.dtypes import Bool, Float32, Float64, Int32, UInt8
from scenarionet_sim.kernels.bicycle import drive_bicycle
from scenarionet_sim.kernels.idm import Law, drive_along_paths
from scenarionet_sim.kernels.log import VALID
from scenarionet_sim.kernels.motion import move_on, replay
from scenarionet_sim.kernels.overlap import touch
from scenarionet_sim.kernels.paths import PathRows, locate
from scenarionet_sim.kernels.rays import ranges_to_boxes, ranges_to_lines
from scenarionet_sim.kernels.route_observation import own_motion, way_ahead
from scenarionet_sim.kernels.scoring import StepResult, score
from scenarionet_sim.kernels.structures import (
    DRIVERS,
    FIRST_STEP,
    LOG,
    NUM_OBJECTS,
    OBJECTS,
    Lines,
    Recorded,
    StateArrays,
)

MOVE, DRIVE, LOCATE, SCORE, OBSERVE, ONLY_BEGUN = (1 << bit for bit in range(6))
"""Phases of a step, in order: traffic moves; agents drive by their actions; they are located and their contacts found;
scored; observed. ``ONLY_BEGUN``: in worlds that have just begun an episode alone."""

UNCOMPILED, REPLAY, ENTER, CARRY_ON, FOLLOW_PATH = range(5)
"""How a policy moves its objects: outside of the kernel; as recorded; only appearing; at constant velocity; by IDM."""

LIDAR, LINE_RAYS, OWN_MOTION, WAY_AHEAD = range(4)
"""Kinds of sensors."""

UNDRIVEN = 255
"""A policy number: a row that no policy drives and that is never present."""


class Traffic(NamedTuple):
    """Policies of P numbers.

    Attributes:
        driver: (W, N) policy of each object, or ``UNDRIVEN``.
        movement: (P,) see ``REPLAY``.
        law: (W, P, 8) numbers of a ``Law``.
        colors: (K,) ``LightColor`` by ``LightState``.
    """

    driver: UInt8
    movement: UInt8
    law: Float64
    colors: UInt8


class DrivenArrays(NamedTuple):
    """Agents of W worlds in the order of their worlds and rows.

    Attributes:
        rows: (A, 2) world and row.
        first: (W + 1,) first agent of each world.
        actions: (A, 2) steering and throttle.
        route, route_before: (W, N, 2) location on their paths, see ``State``; after the step, and before it.
        contacts, contacts_before: (A, N) objects that they touch.
        hits: (A,) types of those objects, as bits.
    """

    rows: Int32
    first: Int32
    actions: Float64
    route: Float64
    route_before: Float64
    contacts: Bool
    contacts_before: Bool
    hits: npt.NDArray[np.uint32]


class Sensing(NamedTuple):
    """Compiled sensors of the agents.

    Attributes:
        kind: (S,) see ``LIDAR``.
        place: (S, 4) first value of the sensor's part of ``out``; values from one agent to the next; first row in
            ``directions``; number of rays or points.
        scale: (S, 8) range or spacing [m], then what values are divided by (points) or multiplied by (own motion).
        types: (S, 256) visible types; all objects for a lidar whose row is all True.
        directions: (R, 2) unit vectors of the rays of all sensors.
        out: Values of all agents, one after another.
    """

    kind: UInt8
    place: Int32
    scale: Float64
    types: Bool
    directions: Float64
    out: Float32

    @classmethod
    def of_no_sensors(cls) -> Sensing:
        """Return the arrays of no sensors."""
        no_place, no_types = np.zeros((0, 4), np.int32), np.zeros((0, 256), np.bool_)
        return cls(
            np.zeros(0, np.uint8), no_place, np.zeros((0, 8)), no_types, np.zeros((0, 2)), np.zeros(0, np.float32)
        )


class Scratch(NamedTuple):
    """Memory for one agent's observation.

    Attributes:
        values: (7,) own motion.
        points: (K, 2) points of the path.
        is_visible: (N,) objects that a lidar sees.
    """

    values: Float64
    points: Float64
    is_visible: Bool

    @classmethod
    def of(cls, num_objects: int, sensing: Sensing) -> Scratch:
        """Allocate the memory."""
        most = max(sensing.place[:, 3], default=0)
        return cls(np.empty(7), np.empty((most, 2)), np.empty(num_objects, np.bool_))


@kernel(allocates=False)
def begin_worlds(
    slots: Int32, starts: Int32, recorded: Recorded, now: StateArrays, then: StateArrays, driver: UInt8
) -> None:
    """Set slots to a timestep of the logs of their worlds, in the current and in the next state.

    Args:
        slots: (B,) the slots.
        starts: (B,) timesteps; -1 for the first at which the ego is valid.
        recorded: Logs of W worlds.
        now, then: The two states.
        driver: (W, N) policy of each object, written.
    """
    for b in range(len(slots)):
        w = slots[b]
        count, objects = recorded.place[w, NUM_OBJECTS], recorded.place[w, OBJECTS]
        start = recorded.place[w, FIRST_STEP] if starts[b] < 0 else starts[b]
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
        _copy(w, driver.shape[1], now, then)


@kernel(allocates=False)
def list_agents(driver: UInt8, present: Bool, is_agent: Bool, rows: Int32, first: Int32) -> bool:
    """List the present agents.

    Args:
        driver, present: (W, N) policy of each object, and whether it is present.
        is_agent: (256,) policies of agents.
        rows: (W * N, 2) output: world and row of each agent.
        first: (W + 1,) output: first agent of each world.

    Returns:
        Whether another agent is still absent.
    """
    count, is_due = 0, False
    for w in range(driver.shape[0]):
        first[w] = count
        for n in range(driver.shape[1]):
            if is_agent[driver[w, n]]:
                if present[w, n]:
                    rows[count, 0], rows[count, 1] = w, n
                    count += 1
                else:
                    is_due = True
    first[driver.shape[0]] = count
    return is_due


@kernel(nogil=True, allocates=False)
def step_worlds(
    span: tuple[int, int, int, int],
    numbers: tuple[float, float, float, float],
    has_begun: Bool,
    recorded: Recorded,
    lines: Lines,
    now: StateArrays,
    then: StateArrays,
    traffic: Traffic,
    agents: DrivenArrays,
    vehicles: Float64,
    task: Float64,
    result: StepResult,
    sensing: Sensing,
    scratch: Scratch,
) -> int:
    """Advance worlds by one step.

    Args:
        span: First world and end; phases; substeps of the vehicle model.
        numbers: Length of the step [s]; search window on a path behind and ahead of an agent [m]; 1 if the routes
            of the agents are those of the state, 0 if they have a location of their own.
        has_begun: (W,) worlds that have just begun an episode: they do not move in this step.
        recorded, lines: Worlds.
        now, then: Current and next state.
        traffic: Policies.
        agents: DrivenArrays and their contacts.
        vehicles: (W, N, NUM_COLUMNS) see ``kernels.bicycle``.
        task: (12,) see ``task.task_parameters``.
        result: Scores.
        sensing: Sensors.
        scratch: Memory of this call.

    Returns:
        An agent that is not located on its path, or -1.
    """
    first, end, phases, substeps = span
    dt, back, ahead, is_own = numbers
    lost = -1
    for w in range(first, end):
        a0, a1 = agents.first[w], agents.first[w + 1]
        if not has_begun[w]:
            if phases & ONLY_BEGUN:
                continue
            if phases & MOVE:
                _move(w, dt, recorded, now, then, traffic)
            if phases & DRIVE:
                for a in range(a0, a1):
                    n, action = agents.rows[a, 1], agents.actions[a]
                    drive_bicycle(
                        action[0], action[1], dt, substeps, vehicles[w, n], then.size[w, n, 0], then.motion[w, n]
                    )
        if phases & LOCATE:
            for a in range(a0, a1):
                _locate(a, w, agents.rows[a, 1], back, ahead, is_own != 0.0, recorded, then, agents)
        if phases & SCORE:
            if has_begun[w]:
                _begin(w, a0, a1, agents, result)
            else:
                for a in range(a0, a1):
                    _score(a, w, agents.rows[a, 1], recorded, then, agents, task, result)
        if phases & OBSERVE:
            for a in range(a0, a1):
                n = agents.rows[a, 1]
                if np.isnan(agents.route[w, n, 0]):
                    lost = a
                _observe(a, w, n, recorded, lines, then, agents.route, sensing, scratch)
    return lost


@kernel(nogil=True, allocates=False)
def drive_by_idm(
    first: int,
    end: int,
    dt: float,
    has_begun: Bool,
    recorded: Recorded,
    now: StateArrays,
    then: StateArrays,
    traffic: Traffic,
) -> None:
    """Write the next state of objects that follow paths by IDM; a kernel of its own, which replays need not compile.

    Args:
        first, end: Range of worlds, moved already by :func:`step_worlds`.
        dt: Length of the step [s].
        has_begun, recorded, now, then, traffic: See :func:`step_worlds`.
    """
    for w in range(first, end):
        for policy in range(len(traffic.movement)):
            if has_begun[w] or traffic.movement[policy] != FOLLOW_PATH:
                continue
            if recorded.place[w, DRIVERS] >> policy & 1:
                row = traffic.law[w, policy]
                law = Law(row[0], row[1], row[2], row[3], row[4], row[5], row[6], row[7])
                drive_along_paths(w, recorded, now, then, traffic.driver, policy, dt, law, traffic.colors)


@device_function
def _copy(w: int, count: int, source: StateArrays, target: StateArrays) -> None:
    """Copy presence and routes of the objects of a world, and the motion of those that are present."""
    for n in range(count):
        target.present[w, n] = source.present[w, n]
        target.route[w, n, 0], target.route[w, n, 1] = source.route[w, n, 0], source.route[w, n, 1]
        if source.present[w, n]:
            for column in range(source.motion.shape[2]):
                target.motion[w, n, column] = source.motion[w, n, column]


@device_function(forceinline=True)
def _move(w: int, dt: float, recorded: Recorded, now: StateArrays, then: StateArrays, traffic: Traffic) -> None:
    """Write the next state of all objects that do not follow paths and whose policy is compiled; others keep theirs."""
    _copy(w, recorded.place[w, NUM_OBJECTS], now, then)
    then.timestep[w] = now.timestep[w] + 1
    t, driver = now.timestep[w], traffic.driver
    for policy in range(len(traffic.movement)):
        movement = traffic.movement[policy]
        if movement == UNCOMPILED or not recorded.place[w, DRIVERS] >> policy & 1:
            continue
        if movement < CARRY_ON:
            replay(w, recorded, t, driver, policy, movement == ENTER, then.motion, then.present)
        elif movement == CARRY_ON:
            move_on(w, recorded, t, driver, policy, dt, then.motion, then.present)


@device_function(forceinline=True)
def _locate(
    a: int,
    w: int,
    n: int,
    back: float,
    ahead: float,
    is_own: bool,
    recorded: Recorded,
    then: StateArrays,
    agents: DrivenArrays,
) -> None:
    """Locate an agent on its path, and find its contacts."""
    route = agents.route[w, n]
    if not is_own:
        agents.route_before[w, n, 0], agents.route_before[w, n, 1] = route[0], route[1]
    row = recorded.place[w, OBJECTS] + n
    path = PathRows(recorded.path, recorded.path_offsets[row], recorded.path_offsets[row + 1])
    locate(path, back, ahead, then.motion[w, n], route, is_own)
    contacts = agents.contacts[a]
    agents.hits[a] = touch(n, then.motion[w], then.size[w], then.object_type[w], then.present[w], contacts)


@device_function(forceinline=True)
def _begin(w: int, first: int, end: int, agents: DrivenArrays, result: StepResult) -> None:
    """Clear the scores of a world; contacts at the beginning do not count as crashes."""
    for n in range(result.totals.shape[1]):
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


@device_function(forceinline=True)
def _observe(
    a: int,
    w: int,
    n: int,
    recorded: Recorded,
    lines: Lines,
    then: StateArrays,
    routes: Float64,
    sensing: Sensing,
    scratch: Scratch,
) -> None:
    """Write the observations of an agent by all compiled sensors."""
    me, route, row = then.motion[w, n], routes[w, n], recorded.place[w, OBJECTS] + n
    path = PathRows(recorded.path, recorded.path_offsets[row], recorded.path_offsets[row + 1])
    for s in range(len(sensing.kind)):
        kind, scale, count = sensing.kind[s], sensing.scale[s], sensing.place[s, 3]
        at, ray = sensing.place[s, 0] + a * sensing.place[s, 1], sensing.place[s, 2]
        if kind == LIDAR:
            is_visible = scratch.is_visible
            for m in range(len(is_visible)):
                is_visible[m] = then.present[w, m] and sensing.types[s, then.object_type[w, m]]
            rays = sensing.directions[ray : ray + count]
            ranges_to_boxes(n, then.motion[w], then.size[w], is_visible, rays, scale[0], sensing.out[at : at + count])
        elif kind == LINE_RAYS:
            rays = sensing.directions[ray : ray + count]
            ranges_to_lines(w, me, lines, sensing.types[s], rays, scale[0], sensing.out[at : at + count])
        elif kind == OWN_MOTION:
            own_motion(me, route, then.size[w, n, 0], path, scale[7], scratch.values)
            for k in range(7):
                sensing.out[at + k] = _within(np.float32(scratch.values[k] * scale[k]))
        elif kind == WAY_AHEAD:
            points = scratch.points[:count]
            way_ahead(me, route, path, scale[0], points)
            for k in range(count):
                sensing.out[at + 2 * k] = _within(np.float32(points[k, 0] / scale[1]))
                sensing.out[at + 2 * k + 1] = _within(np.float32(points[k, 1] / scale[1]))


@device_function
def _within(value: np.float32) -> np.float32:
    """Limit a value to [-1, 1]."""
    return np.float32(-1.0) if value < -1.0 else (np.float32(1.0) if value > 1.0 else value)
