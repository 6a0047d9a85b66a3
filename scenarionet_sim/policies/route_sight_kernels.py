"""What an agent sees of the traffic on its route, and how the driver model with a steering law would drive there."""

from __future__ import annotations

import numpy as np

from scenarionet_data.arrays.dtypes import Float32, Float64, Int32, UInt8
from scenarionet_data.arrays.idm import free_acceleration
from scenarionet_data.compiled.decorators import device_function, kernel
from scenarionet_sim.arrays.boxes import HALF_LENGTH, HALF_WIDTH, write_boxes
from scenarionet_sim.arrays.log import ARC, HEADING, VX, VY, X, Y, Z
from scenarionet_sim.arrays.minmax import larger, smaller
from scenarionet_sim.arrays.structures import LIGHTS, NUM_OBJECTS, NUM_STEPS, OBJECTS, Recorded, StateArrays
from scenarionet_sim.policies.idm_kernels import (
    Law,
    braking_for_boxes,
    braking_for_light,
    speed_for_bends,
)
from scenarionet_sim.policies.strip_kernels import SightMemory, find_near, look_ahead, meet
from scenarionet_sim.worlds.path_kernels import PathRows, pose_on, segment_at, segment_from

LEADER = 3
"""Numbers of each leader: 1, gap [m], speed along the route [m/s]."""


@device_function
def _look(w: int, n: int, way: PathRows, recorded: Recorded, now: StateArrays, memory: SightMemory) -> tuple[int, int]:
    """Write the stations on an agent's route and the boxes of its world; return their number and its own box."""
    write_boxes(recorded.place[w, NUM_OBJECTS], now.motion[w], now.size[w], now.present[w], memory.boxes)
    s, own = larger(now.route[w, n, 0], 0.0), 0
    for row in range(n):
        own += int(now.present[w, row])
    count = look_ahead(way, segment_at(way, s), s, memory.stations) if way.end - way.first > 1 else 0
    return count, own


@kernel
def observe_leaders(
    agents: Int32,
    recorded: Recorded,
    now: StateArrays,
    margin: float,
    reach: float,
    memory: SightMemory,
    out: Float64,
) -> int:
    """Observe the boxes on the strip that each agent will sweep along its route, nearest first.

    Args:
        agents: (A, 2) world and row.
        recorded, now: Worlds and their state.
        margin: What the strip is wider than the agent, on each side [m].
        reach: Gap beyond which a box is not seen [m].
        memory: Written.
        out: (A, 2 + 3 K) output: cruising speed, the highest of the recording [m/s]; way that is left [m]; then of each
            box see ``LEADER``.

    Returns:
        Index of the first agent whose arc length is NaN (not located on its path), or -1.
    """
    lost, most = -1, (out.shape[1] - 2) // LEADER
    for a in range(agents.shape[0]):
        w, n = agents[a, 0], agents[a, 1]
        out[a, :] = 0.0
        if np.isnan(now.route[w, n, 0]):
            lost = a if lost < 0 else lost
            continue
        objects = recorded.place[w, OBJECTS]
        way = PathRows(recorded.path, recorded.path_offsets[objects + n], recorded.path_offsets[objects + n + 1])
        count, own = _look(w, n, way, recorded, now, memory)
        out[a, 0] = recorded.top_speed[objects + n]
        if count == 0:
            continue
        out[a, 1] = way.points[way.end - 1, ARC] - now.route[w, n, 0]
        numbers, found, seen = memory.boxes.numbers, 0, out[a, 2:]
        half_width = numbers[HALF_WIDTH, own] + margin
        find_near(memory, count, half_width)
        for b in range(memory.boxes.num_boxes[0]):
            other = memory.boxes.row[b]
            level = (now.size[w, other, 2] + now.size[w, n, 2]) / 2.0
            if not memory.is_near[b] or b == own or abs(now.motion[w, other, Z] - now.motion[w, n, Z]) > level:
                continue
            distance, speed = meet(now.motion[w], memory, b, count, half_width)
            gap = distance - numbers[HALF_LENGTH, own]
            if gap > reach or (found == most and gap >= seen[LEADER * (most - 1) + 1]):
                continue
            found = smaller(found + 1, most)
            place = found - 1
            while place > 0 and seen[LEADER * (place - 1) + 1] > gap:
                for k in range(LEADER):
                    seen[LEADER * place + k] = seen[LEADER * (place - 1) + k]
                place -= 1
            seen[LEADER * place], seen[LEADER * place + 1], seen[LEADER * place + 2] = 1.0, gap, speed
    return lost


@kernel
def guide(
    agents: Int32,
    recorded: Recorded,
    now: StateArrays,
    colors: UInt8,
    law: Float64,
    limits: Float64,
    memory: SightMemory,
    out: Float32,
) -> int:
    """Return what the driver model would do at each agent's place: its acceleration, and pure pursuit of the route.

    Pure pursuit (Coulter 1992) aims the rear axle at a point of the route.

    Args:
        agents: (A, 2) world and row.
        recorded, now: Worlds and their state.
        colors: (K,) ``LightColor`` by ``LightState``.
        law: (8,) see ``idm_kernels.Law``.
        limits: (9,) distance ahead of the point [s, at least m]; of the vehicle: largest angle of the wheels [rad],
            acceleration and braking [m/s²], wheelbase as a share of the length; of the stop at the end of the route:
            deceleration [m/s²], distance from the end [m], time in which another speed decays to it [s].
        memory: Written.
        out: (A, 2) steering and throttle in [-1, 1].

    Returns:
        Index of the first agent whose arc length is NaN (not located on its path), or -1.
    """
    lost = -1
    rule = Law(law[0], law[1], law[2], law[3], law[4], law[5], law[6], law[7])
    for a in range(agents.shape[0]):
        w, n = agents[a, 0], agents[a, 1]
        out[a, 0], out[a, 1] = 0.0, 0.0
        if np.isnan(now.route[w, n, 0]):
            lost = a if lost < 0 else lost
            continue
        objects = recorded.place[w, OBJECTS]
        way = PathRows(recorded.path, recorded.path_offsets[objects + n], recorded.path_offsets[objects + n + 1])
        count, own = _look(w, n, way, recorded, now, memory)
        if count == 0:
            continue
        row, length, s = now.motion[w, n], now.size[w, n, 0], larger(now.route[w, n, 0], 0.0)
        speed, end = np.hypot(row[VX], row[VY]), np.float64(way.points[way.end - 1, ARC])
        braking = braking_for_boxes(now.motion[w], now.size[w], memory, own, count, speed, rule)
        num_steps = recorded.place[w, NUM_STEPS]
        lights = recorded.place[w, LIGHTS] + smaller(now.timestep[w], num_steps - 1)
        for stop in range(recorded.stop_offsets[objects + n], recorded.stop_offsets[objects + n + 1]):
            color = colors[recorded.light_state[lights + recorded.stop_light[stop] * num_steps]]
            gap = recorded.stop_arc[stop] - s - length / 2.0
            braking = larger(braking, braking_for_light(color, gap, speed, rule))
        top_speed = larger(np.float64(recorded.top_speed[objects + n]), rule.slowest)
        desired = speed_for_bends(top_speed, memory.stations, count, rule)
        wanted = free_acceleration(speed, desired, rule.acceleration, rule.deceleration) - braking
        from_here = np.sqrt(2.0 * limits[6] * larger(end - limits[7] - s, 0.0))  # speed from which it stops there
        wanted = smaller(wanted, (from_here - speed) / limits[8] - limits[6])
        wanted = larger(wanted, -rule.hardest)
        out[a, 1] = larger(smaller(wanted / (limits[3] if wanted > 0.0 else limits[4]), 1.0), -1.0)
        out[a, 0] = _pursue(row, way, s, speed, length * limits[5], limits)
    return lost


@device_function
def _pursue(row: Float64, way: PathRows, s: float, speed: float, wheelbase: float, limits: Float64) -> float:
    """Return the steering in [-1, 1] by which the rear axle meets the route ahead."""
    cos, sin = np.cos(row[HEADING]), np.sin(row[HEADING])
    ahead = larger(limits[0] * speed, limits[1])
    end = np.float64(way.points[way.end - 1, ARC])
    at = smaller(s + ahead, end)
    x, y, _, heading = pose_on(way, segment_from(way, segment_at(way, s), at), at)
    x, y = x + (s + ahead - at) * np.cos(heading), y + (s + ahead - at) * np.sin(heading)  # straight on beyond the end
    dx, dy = x - row[X] + 0.5 * wheelbase * cos, y - row[Y] + 0.5 * wheelbase * sin
    left, squared = cos * dy - sin * dx, dx * dx + dy * dy
    angle = np.arctan(2.0 * wheelbase * left / larger(squared, 1.0))
    return float(larger(smaller(angle / limits[2], 1.0), -1.0))
