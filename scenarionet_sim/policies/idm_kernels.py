"""Reactive traffic on recorded paths: it brakes for objects on the path ahead, for traffic lights and for bends.

The law is the Intelligent Driver Model (Treiber, Hennecke, Helbing 2000). Leaders are found by geometry: any object
whose box overlaps the strip that the vehicle will sweep along its path.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from scenarionet_data.arrays.dtypes import Float32, Float64
from scenarionet_data.arrays.idm import free_acceleration, interaction
from scenarionet_data.compiled.decorators import device_function
from scenarionet_sim.arrays.boxes import HALF_LENGTH, HALF_WIDTH, RADIUS, Boxes, rotation, write_boxes
from scenarionet_sim.arrays.boxes import X as BOX_X
from scenarionet_sim.arrays.boxes import Y as BOX_Y
from scenarionet_sim.arrays.log import ARC, HEADING, VALID, VX, VY, YAW_RATE, X, Y, Z
from scenarionet_sim.arrays.minmax import larger, smaller
from scenarionet_sim.arrays.overlap import is_overlapping
from scenarionet_sim.arrays.structures import EGO, LIGHTS, LOG, NUM_OBJECTS, NUM_STEPS, OBJECTS, Recorded, StateArrays
from scenarionet_sim.policies.motion_kernels import place_as_recorded
from scenarionet_sim.policies.strip_kernels import (
    STATION_ARC,
    STATION_HEADING,
    SightMemory,
    find_near,
    look_ahead,
    meet,
)
from scenarionet_sim.policies.traffic import Traffic
from scenarionet_sim.worlds.path_kernels import PathRows, direction, nearest, pose_on, segment_at, segment_from, wrapped


class Law(NamedTuple):
    """Parameters of the driver model, see ``policies.Idm``; all float."""

    headway: float
    acceleration: float
    deceleration: float
    standstill: float
    slowest: float
    lateral: float
    overlap: float
    hardest: float


_YELLOW, _RED = 2, 3  # LightColor
_MOST_ACCELERATION = 12.0
"""Of any step, lateral acceleration included [m/s²]."""


@device_function
def drive_along_paths(
    w: int,
    policy_id: int,
    dt: float,
    recorded: Recorded,
    now: StateArrays,
    then: StateArrays,
    traffic: Traffic,
    memory: SightMemory,
) -> None:
    """Advance every object of a policy in a world by one step.

    An object appears as recorded, at the first valid timestep at which its place is free. It leaves at the end of
    its path, where its arc length becomes infinite; the ego, whose episode goes on, stops there and stays.

    Args:
        w, policy_id: The world, and the policy whose objects move.
        dt: [s].
        recorded: Logs, paths and lights of W worlds.
        now: Current state.
        then: Next state, initially a copy of ``now``; the policy's rows are written.
        traffic: Policies.
        memory: Written.
    """
    driver, colors, numbers = traffic.driver, traffic.colors, traffic.law[w, policy_id]
    law = Law(numbers[0], numbers[1], numbers[2], numbers[3], numbers[4], numbers[5], numbers[6], numbers[7])
    stations, boxes = memory.stations, memory.boxes
    count, num_steps, objects = recorded.place[w, NUM_OBJECTS], recorded.place[w, NUM_STEPS], recorded.place[w, OBJECTS]
    motion, sizes = now.motion[w], now.size[w]
    write_boxes(count, motion, sizes, now.present[w], boxes)
    t, own = smaller(now.timestep[w], num_steps - 1), -1
    log, lights = recorded.place[w, LOG] + (t + 1) * count, recorded.place[w, LIGHTS] + t
    for n in range(count):
        own += now.present[w, n]
        if driver[w, n] != policy_id:
            continue
        then.route[w, n, 1], then.present[w, n] = 0.0, False
        s, size = now.route[w, n, 0], now.size[w, n]
        if s == np.inf:
            continue
        if not now.present[w, n]:
            if t + 1 < num_steps and _is_free(recorded.log[log + n], size, motion, sizes, boxes):
                place_as_recorded(recorded.log[log + n], w, n, then.motion, then.present)
            continue
        path = PathRows(recorded.path, recorded.path_offsets[objects + n], recorded.path_offsets[objects + n + 1])
        row = now.motion[w, n]
        if np.isnan(s):
            s = larger(nearest(path, row[X], row[Y], -np.inf, np.inf)[0], 0.0)
        speed = np.hypot(row[VX], row[VY])
        k = segment_at(path, s)
        num_stations = look_ahead(path, k, s, stations)
        braking = braking_for_boxes(motion, sizes, memory, own, num_stations, speed, law)
        for stop in range(recorded.stop_offsets[objects + n], recorded.stop_offsets[objects + n + 1]):
            color = colors[recorded.light_state[lights + recorded.stop_light[stop] * num_steps]]
            gap = recorded.stop_arc[stop] - s - size[0] / 2.0
            braking = larger(braking, braking_for_light(color, gap, speed, law))
        top_speed = larger(np.float64(recorded.top_speed[objects + n]), law.slowest)
        desired = speed_for_bends(top_speed, stations, num_stations, law)
        wanted = free_acceleration(speed, desired, law.acceleration, law.deceleration) - braking
        new_speed = larger(speed + larger(wanted, -law.hardest) * dt, 0.0)
        end = path.points[path.end - 1, ARC]
        if n == recorded.place[w, EGO]:
            stopping = speed_before_stop(end - s, speed, law.deceleration, dt)
            new_speed = smaller(new_speed, larger(stopping, speed - law.hardest * dt))
        s += (speed + new_speed) / 2.0 * dt
        if s >= end and n == recorded.place[w, EGO]:
            s, new_speed = end, 0.0
        elif s >= end:
            then.route[w, n, 0] = np.inf
            continue
        k = segment_from(path, k, s)
        tx, ty, _ = direction(path, k)
        x, y, z, angle = pose_on(path, k, s)
        moved = then.motion[w, n]
        moved[X], moved[Y], moved[Z], moved[HEADING] = x, y, z, angle
        dx, dy = new_speed * tx - row[VX], new_speed * ty - row[VY]
        share = smaller(_MOST_ACCELERATION * dt / larger(np.sqrt(dx * dx + dy * dy), 1e-9), 1.0)
        if share < 1.0:  # at a kink of the path, for example by the noise of a standing object
            moved[VX], moved[VY] = row[VX] + share * dx, row[VY] + share * dy
        else:
            moved[VX], moved[VY] = new_speed * tx, new_speed * ty
        moved[YAW_RATE] = wrapped(angle - row[HEADING]) / dt
        then.route[w, n, 0], then.present[w, n] = s, True


@device_function
def speed_before_stop(distance: float, speed: float, deceleration: float, dt: float) -> float:
    """Return the highest speed after a step from which a constant deceleration still stops within a distance.

    It is the positive solution of v² = 2 b (distance - (speed + v) / 2 dt), or 0.
    """
    half = 0.5 * deceleration * dt
    square = half * half + deceleration * (2.0 * distance - speed * dt)
    return max(math.sqrt(max(square, 0.0)) - half, 0.0)


@device_function
def _is_free(row: Float32, size: Float64, motion: Float64, sizes: Float64, boxes: Boxes) -> bool:
    """Return whether a row of the log is valid and its box overlaps no other."""
    if row[VALID] == 0.0:
        return False
    numbers, heading = boxes.numbers, np.float64(row[HEADING])
    box = np.cos(heading), np.sin(heading), size[0], size[1]
    for b in range(boxes.num_boxes[0]):
        dx, dy, reach = numbers[BOX_X, b] - row[X], numbers[BOX_Y, b] - row[Y], numbers[RADIUS, b] + size[0] + size[1]
        if dx * dx + dy * dy > reach * reach:
            continue
        other = boxes.row[b]
        cos, sin = rotation(b, motion, boxes)
        is_level = abs(motion[other, Z] - row[Z]) <= sizes[other, 2] / 2.0 + size[2] / 2.0
        if is_level and is_overlapping(dx, dy, box, (cos, sin, sizes[other, 0], sizes[other, 1])):
            return False
    return True


@device_function
def braking_for_boxes(
    motion: Float64, sizes: Float64, memory: SightMemory, own: int, count: int, speed: float, law: Law
) -> float:
    """Return the strongest deceleration required by boxes on the strip along ``count`` stations [m/s²]."""
    boxes, numbers, row = memory.boxes, memory.boxes.numbers, memory.boxes.row[own]
    half_width, braking = numbers[HALF_WIDTH, own] - law.overlap, 0.0
    find_near(memory, count, half_width)
    for b in range(boxes.num_boxes[0]):
        if not memory.is_near[b] or b == own:
            continue
        other = boxes.row[b]
        if abs(motion[other, Z] - motion[row, Z]) > sizes[other, 2] / 2.0 + sizes[row, 2] / 2.0:
            continue
        distance, moves_on = meet(motion, memory, b, count, half_width)
        if distance < np.inf:
            gap = distance - numbers[HALF_LENGTH, own]
            braking = larger(braking, _braking(speed, gap, speed - moves_on, law))
    return braking


@device_function
def _braking(speed: float, gap: float, closing: float, law: Law) -> float:
    return interaction(speed, gap, closing, law.headway, law.acceleration, law.deceleration, law.standstill)


@device_function
def braking_for_light(color: int, gap: float, speed: float, law: Law) -> float:
    """Return the deceleration for a red light within emergency braking, or a yellow one within comfortable braking."""
    if gap < -0.5 or (color != _RED and color != _YELLOW):
        return 0.0
    needed = speed * speed / (2.0 * larger(gap, 0.1))
    if needed > (law.hardest if color == _RED else law.deceleration):
        return 0.0
    return _braking(speed, gap, speed, law)


@device_function
def speed_for_bends(top_speed: float, stations: Float64, count: int, law: Law) -> float:
    """Return the highest speed up to ``top_speed`` that can still be reduced for every bend ahead [m/s].

    It is reduced at half the comfortable braking, so that bends further ahead than that takes do not matter.
    """
    highest = np.inf
    for k in range(count - 1):
        distance = stations[k, STATION_ARC] - stations[0, STATION_ARC]
        if law.deceleration * distance >= smaller(highest, top_speed * top_speed):
            break
        bend = abs(wrapped(stations[k + 1, STATION_HEADING] - stations[k, STATION_HEADING]))
        length = stations[k + 1, STATION_ARC] - stations[k, STATION_ARC]
        if bend > 1e-3 * length:
            highest = smaller(highest, law.lateral * length / bend + law.deceleration * distance)
    return smaller(top_speed, float(np.sqrt(highest)))
