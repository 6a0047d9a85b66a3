"""Reactive traffic on recorded paths: it brakes for objects on the path ahead, for traffic lights and for bends.

The law is the Intelligent Driver Model (Treiber, Hennecke, Helbing 2000). Leaders are found by geometry: any object
whose box overlaps the strip that the vehicle will sweep along its path.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from scenarionet_data.arrays.compiled import device_function
from scenarionet_data.arrays.dtypes import Float32, Float64, UInt8
from scenarionet_data.arrays.idm import free_acceleration, interaction
from scenarionet_sim.kernels.log import ARC, HEADING, VALID, VX, VY, YAW_RATE, X, Y, Z
from scenarionet_sim.kernels.minmax import larger, smaller
from scenarionet_sim.kernels.motion import place_as_recorded
from scenarionet_sim.kernels.overlap import is_overlapping
from scenarionet_sim.kernels.paths import PathRows, direction, nearest, pose_at, segment_at, wrapped
from scenarionet_sim.kernels.structures import LIGHTS, LOG, NUM_OBJECTS, NUM_STEPS, OBJECTS, Recorded, StateArrays


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


class SightMemory(NamedTuple):
    """Memory for what one vehicle after another sees.

    Attributes:
        stations: (64, 4) places on its path ahead.
        boxes: (11, N) present objects of its world.
    """

    stations: Float64
    boxes: Float64

    @classmethod
    def of(cls, num_objects: int) -> SightMemory:
        """Allocate the memory for worlds of up to so many objects."""
        return cls(np.empty((_STATIONS, 4)), np.empty((11, num_objects)))


_YELLOW, _RED = 2, 3  # LightColor
_STATIONS = 64
_SPACING, _COARSER = 2.0, 1.0 / 12.0  # least distance between stations [m], and its growth with the distance ahead
_SX, _SY, _ARC, _HEADING = range(4)  # columns of stations
_BX, _BY, _BZ, _COS, _SIN, _VX, _VY, _HALF_LENGTH, _HALF_WIDTH, _HALF_HEIGHT, _RADIUS = range(11)  # rows of boxes


@device_function
def drive_along_paths(
    w: int,
    recorded: Recorded,
    now: StateArrays,
    then: StateArrays,
    driver: UInt8,
    policy_id: int,
    dt: float,
    law: Law,
    colors: UInt8,
    memory: SightMemory,
) -> None:
    """Advance every object of a policy in a world by one step.

    An object appears as recorded, at the first valid timestep at which its place is free. It leaves at the end of
    its path, where its arc length becomes infinite.

    Args:
        w: The world.
        recorded: Logs, paths and lights of W worlds.
        now: Current state.
        then: Next state, initially a copy of ``now``; the policy's rows are written.
        driver, policy_id: (W, N) policy of each object, and the policy whose objects move.
        dt: [s].
        law: Parameters of the driver model.
        colors: (K,) ``LightColor`` by ``LightState``.
        memory: Written.
    """
    stations, boxes = memory.stations, memory.boxes[:, : _write_boxes(w, now, memory.boxes)]
    count, num_steps, objects = recorded.place[w, NUM_OBJECTS], recorded.place[w, NUM_STEPS], recorded.place[w, OBJECTS]
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
            if t + 1 < num_steps and _is_free(recorded.log[log + n], size, boxes):
                place_as_recorded(recorded.log[log + n], w, n, then.motion, then.present)
            continue
        path = PathRows(recorded.path, recorded.path_offsets[objects + n], recorded.path_offsets[objects + n + 1])
        row = now.motion[w, n]
        if np.isnan(s):
            s = larger(nearest(path, row[X], row[Y], -np.inf, np.inf)[0], 0.0)
        speed = np.hypot(row[VX], row[VY])
        num_stations = _look_ahead(path, s, stations)
        braking = _braking_for_boxes(boxes, own, stations, num_stations, speed, law)
        for k in range(recorded.stop_offsets[objects + n], recorded.stop_offsets[objects + n + 1]):
            color = colors[recorded.light_state[lights + recorded.stop_light[k] * num_steps]]
            gap = recorded.stop_arc[k] - s - size[0] / 2.0
            braking = larger(braking, _braking_for_light(color, gap, speed, law))
        top_speed = larger(np.float64(recorded.top_speed[objects + n]), law.slowest)
        desired = _speed_for_bends(top_speed, stations, num_stations, law)
        wanted = free_acceleration(speed, desired, law.acceleration, law.deceleration) - braking
        new_speed = larger(speed + larger(wanted, -law.hardest) * dt, 0.0)
        s += (speed + new_speed) / 2.0 * dt
        if s >= path.points[path.end - 1, ARC]:
            then.route[w, n, 0] = np.inf
            continue
        tx, ty, _ = direction(path, segment_at(path, s))
        x, y, z, angle = pose_at(path, s)
        moved = then.motion[w, n]
        moved[X], moved[Y], moved[Z], moved[HEADING] = x, y, z, angle
        moved[VX], moved[VY] = new_speed * tx, new_speed * ty
        moved[YAW_RATE] = wrapped(angle - row[HEADING]) / dt
        then.route[w, n, 0], then.present[w, n] = s, True


@device_function
def _write_boxes(w: int, now: StateArrays, boxes: Float64) -> int:
    """Write the present boxes of a world in the order of their rows; return their number."""
    b = 0
    for n in range(now.present.shape[1]):
        if not now.present[w, n]:
            continue
        row = now.motion[w, n]
        boxes[_BX, b], boxes[_BY, b], boxes[_BZ, b] = row[X], row[Y], row[Z]
        boxes[_COS, b], boxes[_SIN, b] = np.cos(row[HEADING]), np.sin(row[HEADING])
        boxes[_VX, b], boxes[_VY, b] = row[VX], row[VY]
        for axis in range(3):
            boxes[_HALF_LENGTH + axis, b] = now.size[w, n, axis] / 2.0
        boxes[_RADIUS, b] = np.hypot(boxes[_HALF_LENGTH, b], boxes[_HALF_WIDTH, b])
        b += 1
    return b


@device_function
def _is_free(row: Float32, size: Float64, boxes: Float64) -> bool:
    """Return whether a row of the log is valid and its box overlaps no other."""
    if row[VALID] == 0.0:
        return False
    cos, sin = np.cos(np.float64(row[HEADING])), np.sin(np.float64(row[HEADING]))
    for b in range(boxes.shape[1]):
        if abs(boxes[_BZ, b] - row[Z]) <= boxes[_HALF_HEIGHT, b] + size[2] / 2.0 and is_overlapping(
            boxes[_BX, b] - row[X], boxes[_BY, b] - row[Y], cos, sin, size[0], size[1],
            boxes[_COS, b], boxes[_SIN, b], 2.0 * boxes[_HALF_LENGTH, b], 2.0 * boxes[_HALF_WIDTH, b],
        ):  # fmt: skip
            return False
    return True


@device_function
def _look_ahead(path: PathRows, s: float, stations: Float64) -> int:
    """Write stations (x, y, arc, heading) from ``s`` to the end of the path; return their number.

    The law has no horizon: cutting it off would let the acceleration jump when a leader comes into view. Stations are
    wider apart with the distance, so that they reach over a kilometre.
    """
    stations[0, _SX], stations[0, _SY], _, stations[0, _HEADING] = pose_at(path, s)
    stations[0, _ARC] = s
    count, last = 1, s
    for k in range(segment_at(path, s) + 1, path.end):
        spacing = larger(_SPACING, (last - s) * _COARSER)
        if path.points[k, ARC] - last >= spacing or (k == path.end - 1 and path.points[k, ARC] > last):
            stations[count, _SX], stations[count, _SY] = path.points[k, 0], path.points[k, 1]
            stations[count, _ARC], stations[count, _HEADING] = path.points[k, ARC], path.points[k, HEADING]
            count, last = count + 1, np.float64(path.points[k, ARC])
            if count == _STATIONS:
                break
    return count


@device_function
def _braking_for_boxes(boxes: Float64, own: int, stations: Float64, count: int, speed: float, law: Law) -> float:
    """Return the strongest deceleration required by boxes on the strip ahead [m/s²]."""
    half_width = boxes[_HALF_WIDTH, own] - law.overlap
    low_x, high_x, low_y, high_y = np.inf, -np.inf, np.inf, -np.inf
    for k in range(count):
        low_x, high_x = smaller(low_x, stations[k, _SX]), larger(high_x, stations[k, _SX])
        low_y, high_y = smaller(low_y, stations[k, _SY]), larger(high_y, stations[k, _SY])
    braking = 0.0
    for b in range(boxes.shape[1]):
        x, y, reach = boxes[_BX, b], boxes[_BY, b], boxes[_RADIUS, b] + half_width
        if x + reach < low_x or x - reach > high_x or y + reach < low_y or y - reach > high_y or b == own:
            continue
        if abs(boxes[_BZ, b] - boxes[_BZ, own]) > boxes[_HALF_HEIGHT, b] + boxes[_HALF_HEIGHT, own]:
            continue
        distance, moves_on = _meet(boxes, b, stations, count, half_width)
        if distance < np.inf:
            gap = distance - boxes[_HALF_LENGTH, own]
            braking = larger(braking, _braking(speed, gap, speed - moves_on, law))
    return braking


@device_function
def _meet(boxes: Float64, b: int, stations: Float64, count: int, half_width: float) -> tuple[float, float]:
    """Return the distance along the stations to box ``b`` [m], infinite if not on the strip, and its speed along it.

    A box whose centre is not ahead of the first station is a follower and does not count.
    """
    radius, k = boxes[_RADIUS, b], -1
    widest = half_width + radius
    while k < count - 2:
        k += 1
        dx, dy = boxes[_BX, b] - stations[k, _SX], boxes[_BY, b] - stations[k, _SY]
        # The strip cannot reach the box on a shorter way than the straight one: skip the stations before.
        reached = stations[k, _ARC] + np.sqrt(dx * dx + dy * dy) - half_width - 2.0 * radius
        if stations[k + 1, _ARC] < reached:
            while k < count - 2 and stations[k + 2, _ARC] < reached:
                k += 1
            continue
        tx, ty = stations[k + 1, _SX] - stations[k, _SX], stations[k + 1, _SY] - stations[k, _SY]
        along, left, squared = tx * dx + ty * dy, tx * dy - ty * dx, tx * tx + ty * ty
        beside, beyond = widest * widest * squared, radius * radius * squared
        # Squares, as roots and quotients take most of the time.
        if left * left > beside or (along < 0.0 and along * along > beyond):
            continue
        if along > squared and (along - squared) * (along - squared) > beyond:
            continue
        length = larger(np.sqrt(squared), 1e-9)  # shorter than the arc where the path is noisy
        tx, ty = tx / length, ty / length
        along, left = tx * dx + ty * dy, tx * dy - ty * dx
        cos, sin = abs(boxes[_COS, b] * tx + boxes[_SIN, b] * ty), abs(boxes[_COS, b] * ty - boxes[_SIN, b] * tx)
        reach = cos * boxes[_HALF_LENGTH, b] + sin * boxes[_HALF_WIDTH, b]
        across = sin * boxes[_HALF_LENGTH, b] + cos * boxes[_HALF_WIDTH, b]
        if abs(left) >= half_width + across or along - reach >= length or along + reach <= 0.0:
            continue
        if k > 0 or along > 0.0:
            entered = along - reach if k == 0 else larger(along - reach, 0.0)
            return stations[k, _ARC] - stations[0, _ARC] + entered, boxes[_VX, b] * tx + boxes[_VY, b] * ty
    return np.inf, 0.0


@device_function
def _braking(speed: float, gap: float, closing: float, law: Law) -> float:
    return interaction(speed, gap, closing, law.headway, law.acceleration, law.deceleration, law.standstill)


@device_function
def _braking_for_light(color: int, gap: float, speed: float, law: Law) -> float:
    """Return the deceleration for a red light within emergency braking, or a yellow one within comfortable braking."""
    if gap < -0.5 or (color != _RED and color != _YELLOW):
        return 0.0
    needed = speed * speed / (2.0 * larger(gap, 0.1))
    if needed > (law.hardest if color == _RED else law.deceleration):
        return 0.0
    return _braking(speed, gap, speed, law)


@device_function
def _speed_for_bends(top_speed: float, stations: Float64, count: int, law: Law) -> float:
    """Return the highest speed up to ``top_speed`` that can still be reduced for every bend ahead [m/s].

    It is reduced at half the comfortable braking, so that bends further ahead than that takes do not matter.
    """
    highest = np.inf
    for k in range(count - 1):
        distance = stations[k, _ARC] - stations[0, _ARC]
        if law.deceleration * distance >= smaller(highest, top_speed * top_speed):
            break
        bend = abs(wrapped(stations[k + 1, _HEADING] - stations[k, _HEADING]))
        length = stations[k + 1, _ARC] - stations[k, _ARC]
        if bend > 1e-3 * length:
            highest = smaller(highest, law.lateral * length / bend + law.deceleration * distance)
    return smaller(top_speed, float(np.sqrt(highest)))
