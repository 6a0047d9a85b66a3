"""Reactive traffic on recorded paths: it brakes for objects on the path ahead, for traffic lights and for bends.

The law is the Intelligent Driver Model (Treiber, Hennecke, Helbing 2000). Leaders are found by geometry: any object
whose box overlaps the strip that the vehicle will sweep along its path.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from scenarionet_data.arrays.compiled import device_function
from scenarionet_data.arrays.dtypes import Bool, Float32, Float64, UInt8
from scenarionet_data.arrays.idm import free_acceleration, interaction
from scenarionet_sim.kernels.boxes import HALF_LENGTH, HALF_WIDTH, RADIUS, Boxes, rotation, write_boxes
from scenarionet_sim.kernels.boxes import X as BOX_X
from scenarionet_sim.kernels.boxes import Y as BOX_Y
from scenarionet_sim.kernels.log import ARC, HEADING, VALID, VX, VY, YAW_RATE, X, Y, Z
from scenarionet_sim.kernels.minmax import larger, smaller
from scenarionet_sim.kernels.motion import place_as_recorded
from scenarionet_sim.kernels.overlap import is_overlapping
from scenarionet_sim.kernels.paths import PathRows, direction, nearest, pose_on, segment_at, segment_from, wrapped
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
        stations: (64, 7) places on its path ahead: x, y, arc length [m] and heading [rad]; then the middle x, y and
            half of the length [m] of the straight way to the next one.
        boxes: Boxes of its world.
        is_near: (N,) boxes that may be on its path.
    """

    stations: Float64
    boxes: Boxes
    is_near: Bool

    @classmethod
    def of(cls, num_objects: int) -> SightMemory:
        """Allocate the memory for worlds of up to so many objects."""
        return cls(np.empty((_STATIONS, 7)), Boxes.of(num_objects), np.empty(num_objects, np.bool_))


_YELLOW, _RED = 2, 3  # LightColor
_STATIONS = 64
_SPACING, _COARSER = 2.0, 1.0 / 12.0  # least distance between stations [m], and its growth with the distance ahead
_SX, _SY, _ARC, _HEADING, _MIDDLE_X, _MIDDLE_Y, _HALF = range(7)  # columns of stations


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
    stations, boxes = memory.stations, memory.boxes
    count, num_steps, objects = recorded.place[w, NUM_OBJECTS], recorded.place[w, NUM_STEPS], recorded.place[w, OBJECTS]
    motion, sizes = now.motion[w], now.size[w]
    num_boxes = write_boxes(count, motion, sizes, now.present[w], boxes)
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
            if t + 1 < num_steps and _is_free(recorded.log[log + n], size, motion, sizes, boxes, num_boxes):
                place_as_recorded(recorded.log[log + n], w, n, then.motion, then.present)
            continue
        path = PathRows(recorded.path, recorded.path_offsets[objects + n], recorded.path_offsets[objects + n + 1])
        row = now.motion[w, n]
        if np.isnan(s):
            s = larger(nearest(path, row[X], row[Y], -np.inf, np.inf)[0], 0.0)
        speed = np.hypot(row[VX], row[VY])
        k = segment_at(path, s)
        num_stations = _look_ahead(path, k, s, stations)
        braking = _braking_for_boxes(motion, sizes, memory, num_boxes, own, num_stations, speed, law)
        for stop in range(recorded.stop_offsets[objects + n], recorded.stop_offsets[objects + n + 1]):
            color = colors[recorded.light_state[lights + recorded.stop_light[stop] * num_steps]]
            gap = recorded.stop_arc[stop] - s - size[0] / 2.0
            braking = larger(braking, _braking_for_light(color, gap, speed, law))
        top_speed = larger(np.float64(recorded.top_speed[objects + n]), law.slowest)
        desired = _speed_for_bends(top_speed, stations, num_stations, law)
        wanted = free_acceleration(speed, desired, law.acceleration, law.deceleration) - braking
        new_speed = larger(speed + larger(wanted, -law.hardest) * dt, 0.0)
        s += (speed + new_speed) / 2.0 * dt
        if s >= path.points[path.end - 1, ARC]:
            then.route[w, n, 0] = np.inf
            continue
        k = segment_from(path, k, s)
        tx, ty, _ = direction(path, k)
        x, y, z, angle = pose_on(path, k, s)
        moved = then.motion[w, n]
        moved[X], moved[Y], moved[Z], moved[HEADING] = x, y, z, angle
        moved[VX], moved[VY] = new_speed * tx, new_speed * ty
        moved[YAW_RATE] = wrapped(angle - row[HEADING]) / dt
        then.route[w, n, 0], then.present[w, n] = s, True


@device_function
def _is_free(row: Float32, size: Float64, motion: Float64, sizes: Float64, boxes: Boxes, num_boxes: int) -> bool:
    """Return whether a row of the log is valid and its box overlaps no other."""
    if row[VALID] == 0.0:
        return False
    numbers, cos, sin = boxes.numbers, np.cos(np.float64(row[HEADING])), np.sin(np.float64(row[HEADING]))
    for b in range(num_boxes):
        dx, dy, reach = numbers[BOX_X, b] - row[X], numbers[BOX_Y, b] - row[Y], numbers[RADIUS, b] + size[0] + size[1]
        if dx * dx + dy * dy > reach * reach:
            continue
        other = boxes.row[b]
        cos_b, sin_b = rotation(b, motion, boxes)
        if abs(motion[other, Z] - row[Z]) <= sizes[other, 2] / 2.0 + size[2] / 2.0 and is_overlapping(
            dx, dy, cos, sin, size[0], size[1], cos_b, sin_b, sizes[other, 0], sizes[other, 1]
        ):
            return False
    return True


@device_function
def _look_ahead(path: PathRows, k: int, s: float, stations: Float64) -> int:
    """Write stations from ``s``, on segment ``k``, to the end of the path; return their number.

    The law has no horizon: cutting it off would let the acceleration jump when a leader comes into view. Stations are
    wider apart with the distance, so that they reach over a kilometre.
    """
    stations[0, _SX], stations[0, _SY], _, stations[0, _HEADING] = pose_on(path, k, s)
    stations[0, _ARC] = s
    count, last, spacing, end, stride, points = 1, s, _SPACING, path.end - 1, 1, path.points
    while count < _STATIONS and k < end:
        # The first point that is far enough, or the end. Points are mostly as many apart as the last two stations were.
        j = smaller(k + stride, end)
        while j < end and points[j, ARC] - last < spacing:
            j += 1
        while j > k + 1 and points[j - 1, ARC] - last >= spacing:
            j -= 1
        station, stride, k = stations[count], j - k, j
        if points[k, ARC] <= last:
            break
        station[_SX], station[_SY] = points[k, X], points[k, Y]
        station[_ARC], station[_HEADING] = points[k, ARC], points[k, HEADING]
        count, last = count + 1, np.float64(points[k, ARC])
        spacing = larger(_SPACING, (last - s) * _COARSER)
    return count


@device_function
def _braking_for_boxes(
    motion: Float64,
    sizes: Float64,
    memory: SightMemory,
    num_boxes: int,
    own: int,
    count: int,
    speed: float,
    law: Law,
) -> float:
    """Return the strongest deceleration required by boxes on the strip ahead [m/s²]."""
    boxes, stations, numbers, is_near = memory.boxes, memory.stations, memory.boxes.numbers, memory.is_near
    row, half_width = boxes.row[own], numbers[HALF_WIDTH, own] - law.overlap
    low_x, high_x, low_y, high_y = np.inf, -np.inf, np.inf, -np.inf
    for k in range(count):
        x, y, following = stations[k, _SX], stations[k, _SY], stations[smaller(k + 1, count - 1)]
        low_x, high_x, low_y, high_y = smaller(low_x, x), larger(high_x, x), smaller(low_y, y), larger(high_y, y)
        tx, ty = following[_SX] - x, following[_SY] - y
        stations[k, _MIDDLE_X], stations[k, _MIDDLE_Y] = x + 0.5 * tx, y + 0.5 * ty
        stations[k, _HALF] = 0.5 * np.sqrt(tx * tx + ty * ty)
    x, y, reach_x, reach_y = (
        0.5 * (low_x + high_x),
        0.5 * (low_y + high_y),
        0.5 * (high_x - low_x),
        0.5 * (high_y - low_y),
    )
    reach_x, reach_y = reach_x + half_width, reach_y + half_width
    _find_near(num_boxes, x, y, reach_x, reach_y, numbers[BOX_X], numbers[BOX_Y], numbers[RADIUS], is_near)
    is_near[own], braking = False, 0.0
    for b in range(num_boxes):
        if not is_near[b]:
            continue
        other = boxes.row[b]
        if abs(motion[other, Z] - motion[row, Z]) > sizes[other, 2] / 2.0 + sizes[row, 2] / 2.0:
            continue
        distance, moves_on = _meet(motion, boxes, b, stations, count, half_width)
        if distance < np.inf:
            gap = distance - numbers[HALF_LENGTH, own]
            braking = larger(braking, _braking(speed, gap, speed - moves_on, law))
    return braking


@device_function(in_lanes=True)
def _find_near(
    count: int,
    x: float,
    y: float,
    reach_x: float,
    reach_y: float,
    box_x: Float64,
    box_y: Float64,
    radius: Float64,
    is_near: Bool,
) -> None:
    """Find the boxes whose circumscribed circles may meet a rectangle."""
    for b in range(count):
        is_near[b] = (abs(box_x[b] - x) <= reach_x + radius[b]) & (abs(box_y[b] - y) <= reach_y + radius[b])


@device_function
def _meet(
    motion: Float64, boxes: Boxes, b: int, stations: Float64, count: int, half_width: float
) -> tuple[float, float]:
    """Return the distance along the stations to box ``b`` [m], infinite if not on the strip, and its speed along it.

    A box whose centre is not ahead of the first station is a follower and does not count.
    """
    numbers = boxes.numbers
    box_x, box_y, half_length, radius = (
        numbers[BOX_X, b],
        numbers[BOX_Y, b],
        numbers[HALF_LENGTH, b],
        numbers[RADIUS, b],
    )
    widest = half_width + radius
    for k in range(count - 1):
        station = stations[k]
        x, y, reach = box_x - station[_MIDDLE_X], box_y - station[_MIDDLE_Y], station[_HALF] + radius + widest
        if x * x + y * y > reach * reach:
            continue
        dx, dy = box_x - station[_SX], box_y - station[_SY]
        tx, ty = stations[k + 1, _SX] - station[_SX], stations[k + 1, _SY] - station[_SY]
        left, squared = tx * dy - ty * dx, tx * tx + ty * ty
        if left * left > widest * widest * squared:
            continue
        length = larger(np.sqrt(squared), 1e-9)  # shorter than the arc where the path is noisy
        tx, ty = tx / length, ty / length
        along, left = tx * dx + ty * dy, tx * dy - ty * dx
        cos_b, sin_b = rotation(b, motion, boxes)
        cos, sin = abs(cos_b * tx + sin_b * ty), abs(cos_b * ty - sin_b * tx)
        reach, across = (
            cos * half_length + sin * numbers[HALF_WIDTH, b],
            sin * half_length + cos * numbers[HALF_WIDTH, b],
        )
        if abs(left) >= half_width + across or along - reach >= length or along + reach <= 0.0:
            continue
        if k > 0 or along > 0.0:
            entered = along - reach if k == 0 else larger(along - reach, 0.0)
            other = motion[boxes.row[b]]
            return station[_ARC] - stations[0, _ARC] + entered, other[VX] * tx + other[VY] * ty
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
