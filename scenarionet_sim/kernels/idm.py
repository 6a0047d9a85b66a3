"""Traffic on recorded paths that reacts: to what stands or drives on the path ahead, to lights, to bends.

The law is the Intelligent Driver Model (Treiber, Hennecke, Helbing 2000). What is ahead is found by geometry, so
that anything counts: an object whose box reaches into the strip that the vehicle will sweep along its path.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from scenarionet_data.arrays.compiled import device_function, kernel
from scenarionet_data.arrays.dtypes import Bool, Float32, Float64, Int32, UInt8
from scenarionet_data.arrays.idm import free_acceleration, interaction
from scenarionet_sim.kernels.log import HEADING, VALID, X, Y, Z
from scenarionet_sim.kernels.minmax import larger, smaller
from scenarionet_sim.kernels.motion import place_as_recorded
from scenarionet_sim.kernels.overlap import is_overlapping
from scenarionet_sim.kernels.paths import Path, direction, nearest, pose_at, segment_at, wrapped


class Law(NamedTuple):
    """The numbers of the law, see ``policies.Idm``; all float."""

    headway: float
    acceleration: float
    deceleration: float
    standstill: float
    slowest: float
    lateral: float
    overlap: float
    hardest: float


_YELLOW, _RED = 2, 3  # LightColor
_STATIONS = 48
_SPACING = 2.0  # [m] between stations, where they are enough
_SX, _SY, _ARC, _HEADING = range(4)  # columns of stations
_BX, _BY, _BZ, _COS, _SIN, _VX, _VY, _HALF_LENGTH, _HALF_WIDTH, _HALF_HEIGHT, _RADIUS = range(11)  # rows of boxes


@kernel
def drive_along_paths(
    driver: UInt8,
    me: int,
    dt: float,
    law: Law,
    colors: UInt8,
    log: Float32,
    num_steps: Int32,
    timestep: Int32,
    path_points: Float32,
    path_arc: Float32,
    path_heading: Float32,
    path_z: Float32,
    path_offsets: Int32,
    top_speed: Float32,
    stop_arc: Float32,
    stop_light: Int32,
    stop_offsets: Int32,
    light_state: UInt8,
    size: Float64,
    position: Float64,
    heading: Float64,
    velocity: Float64,
    yaw_rate: Float64,  # noqa: ARG001  # a moment is handed on whole
    z: Float64,
    present: Bool,
    arc: Float64,
    next_position: Float64,
    next_heading: Float64,
    next_velocity: Float64,
    next_yaw_rate: Float64,
    next_z: Float64,
    next_present: Bool,
    next_arc: Float64,
    next_lateral: Float64,
) -> None:
    """One step of every object that ``me`` drives; arguments as ``WorldBatch`` and ``State`` name them.

    An object appears as recorded, at the first valid timestep at which its place is free, and leaves at the end
    of its path, where its arc length becomes infinite.
    """
    stations = np.empty((_STATIONS, 4))
    for w in range(len(timestep)):
        boxes = _boxes(w, position, heading, velocity, z, present, size)
        t, mine = smaller(timestep[w], num_steps[w] - 1), -1
        for n in range(driver.shape[1]):
            mine += present[w, n]
            if driver[w, n] != me:
                continue
            next_arc[w, n], next_lateral[w, n], next_present[w, n] = arc[w, n], 0.0, False
            if arc[w, n] == np.inf:
                continue
            if not present[w, n]:
                if t + 1 < num_steps[w] and _is_free(log[w, t + 1, n], size[w, n], boxes):
                    place_as_recorded(
                        log[w, t + 1, n], w, n,
                        next_position, next_heading, next_velocity, next_yaw_rate, next_z, next_present,
                    )  # fmt: skip
                continue
            first, end = path_offsets[w, n], path_offsets[w, n + 1]
            path = Path(path_points[w], path_arc[w], path_heading[w], path_z[w], first, end)
            s = arc[w, n]
            if np.isnan(s):
                s = larger(nearest(path, position[w, n, 0], position[w, n, 1], -np.inf, np.inf)[0], 0.0)
            speed = np.hypot(velocity[w, n, 0], velocity[w, n, 1])
            count = _look_ahead(path, s, _horizon(speed, law) + size[w, n, 0], stations)
            braking = _braking_for_boxes(boxes, mine, stations, count, speed, law)
            for k in range(stop_offsets[w, n], stop_offsets[w, n + 1]):
                color = colors[light_state[w, stop_light[w, k], t]]
                gap = stop_arc[w, k] - s - size[w, n, 0] / 2.0
                braking = larger(braking, _braking_for_light(color, gap, speed, law))
            desired = smaller(larger(np.float64(top_speed[w, n]), law.slowest), _speed_for_bends(stations, count, law))
            wanted = free_acceleration(speed, desired, law.acceleration, law.deceleration) - braking
            new_speed = larger(speed + larger(wanted, -law.hardest) * dt, 0.0)
            s += (speed + new_speed) / 2.0 * dt
            if s >= path.arc[end - 1]:
                next_arc[w, n] = np.inf
                continue
            tx, ty, _ = direction(path, segment_at(path, s))
            x, y, height, angle = pose_at(path, s)
            next_position[w, n, 0], next_position[w, n, 1], next_heading[w, n] = x, y, angle
            next_velocity[w, n, 0], next_velocity[w, n, 1] = new_speed * tx, new_speed * ty
            next_yaw_rate[w, n], next_z[w, n] = wrapped(angle - heading[w, n]) / dt, height
            next_arc[w, n], next_present[w, n] = s, True


@device_function(allocates=True)
def _boxes(
    w: int, position: Float64, heading: Float64, velocity: Float64, z: Float64, present: Bool, size: Float64
) -> Float64:
    """(11, B) what is present in a world, in the order of its rows."""
    count = 0
    for n in range(present.shape[1]):
        count += present[w, n]
    boxes, b = np.empty((11, count)), 0
    for n in range(present.shape[1]):
        if not present[w, n]:
            continue
        boxes[_BX, b], boxes[_BY, b], boxes[_BZ, b] = position[w, n, 0], position[w, n, 1], z[w, n]
        boxes[_COS, b], boxes[_SIN, b] = np.cos(heading[w, n]), np.sin(heading[w, n])
        boxes[_VX, b], boxes[_VY, b] = velocity[w, n, 0], velocity[w, n, 1]
        for axis in range(3):
            boxes[_HALF_LENGTH + axis, b] = size[w, n, axis] / 2.0
        boxes[_RADIUS, b] = np.hypot(boxes[_HALF_LENGTH, b], boxes[_HALF_WIDTH, b])
        b += 1
    return boxes


@device_function
def _is_free(row: Float32, size: Float64, boxes: Float64) -> bool:
    """Whether the log has an object of that size in this row, and nothing is there yet."""
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
def _horizon(speed: float, law: Law) -> float:
    """How far to look ahead [m]: braking in comfort, the headway, and some room."""
    return float(10.0 + speed * law.headway + speed * speed / (2.0 * law.deceleration))


@device_function
def _look_ahead(path: Path, s: float, horizon: float, stations: Float64) -> int:
    """Writes stations (x, y, arc, heading) from ``s`` to the horizon or the path's end; returns how many."""
    spacing = larger(_SPACING, horizon / (_STATIONS - 2))
    stations[0, _SX], stations[0, _SY], _, stations[0, _HEADING] = pose_at(path, s)
    stations[0, _ARC] = s
    count, last = 1, s
    for k in range(segment_at(path, s) + 1, path.end):
        if path.arc[k] - last >= spacing or (k == path.end - 1 and path.arc[k] > last):
            stations[count, _SX], stations[count, _SY] = path.points[k, 0], path.points[k, 1]
            stations[count, _ARC], stations[count, _HEADING] = path.arc[k], path.heading[k]
            count, last = count + 1, np.float64(path.arc[k])
            if last > s + horizon or count == _STATIONS:
                break
    return count


@device_function
def _braking_for_boxes(boxes: Float64, mine: int, stations: Float64, count: int, speed: float, law: Law) -> float:
    """The strongest braking that what is on the strip ahead asks for [m/s2]."""
    half_width = boxes[_HALF_WIDTH, mine] - law.overlap
    low_x, high_x, low_y, high_y = np.inf, -np.inf, np.inf, -np.inf
    for k in range(count):
        low_x, high_x = smaller(low_x, stations[k, _SX]), larger(high_x, stations[k, _SX])
        low_y, high_y = smaller(low_y, stations[k, _SY]), larger(high_y, stations[k, _SY])
    braking = 0.0
    for b in range(boxes.shape[1]):
        x, y, reach = boxes[_BX, b], boxes[_BY, b], boxes[_RADIUS, b] + half_width
        if x + reach < low_x or x - reach > high_x or y + reach < low_y or y - reach > high_y or b == mine:
            continue
        if abs(boxes[_BZ, b] - boxes[_BZ, mine]) > boxes[_HALF_HEIGHT, b] + boxes[_HALF_HEIGHT, mine]:
            continue
        distance, moves_on = _meet(boxes, b, stations, count, half_width)
        if distance < np.inf:
            gap = distance - boxes[_HALF_LENGTH, mine]
            braking = larger(braking, _braking(speed, gap, speed - moves_on, law))
    return braking


@device_function
def _meet(boxes: Float64, b: int, stations: Float64, count: int, half_width: float) -> tuple[float, float]:
    """How far along the stations the strip meets box ``b`` [m], infinite if never, and the box's speed along it.

    A box beside or behind the first station, whose middle is not ahead of it, is not met: it follows.
    """
    radius = boxes[_RADIUS, b]
    for k in range(count - 1):
        length = stations[k + 1, _ARC] - stations[k, _ARC]
        tx = (stations[k + 1, _SX] - stations[k, _SX]) / length
        ty = (stations[k + 1, _SY] - stations[k, _SY]) / length
        dx, dy = boxes[_BX, b] - stations[k, _SX], boxes[_BY, b] - stations[k, _SY]
        along, left = tx * dx + ty * dy, tx * dy - ty * dx
        if abs(left) > half_width + radius or along > length + radius or along < -radius:
            continue
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
    """Braking for a red light ahead that can still be stopped for, or a yellow one in comfort [m/s2]."""
    if gap < -0.5 or (color != _RED and color != _YELLOW):
        return 0.0
    needed = speed * speed / (2.0 * larger(gap, 0.1))
    if needed > (law.hardest if color == _RED else law.deceleration):
        return 0.0
    return _braking(speed, gap, speed, law)


@device_function
def _speed_for_bends(stations: Float64, count: int, law: Law) -> float:
    """The speed that every bend ahead can still be slowed down for, with half the comfortable braking [m/s]."""
    highest = np.inf
    for k in range(count - 1):
        bend = abs(wrapped(stations[k + 1, _HEADING] - stations[k, _HEADING]))
        length, distance = stations[k + 1, _ARC] - stations[k, _ARC], stations[k, _ARC] - stations[0, _ARC]
        if bend > 1e-3 * length:
            highest = smaller(highest, law.lateral * length / bend + law.deceleration * distance)
    return float(np.sqrt(highest))
