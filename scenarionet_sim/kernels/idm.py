"""Traffic on recorded paths that reacts: to what stands or drives on the path ahead, to lights, to bends.

The law is the Intelligent Driver Model (Treiber, Hennecke, Helbing 2000). What is ahead is found by geometry, so
that anything counts: an object whose box reaches into the strip that the vehicle will sweep along its path.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from scenarionet_data.procedural.idm import free_acceleration, interaction
from scenarionet_data.procedural.jit import entry, part
from scenarionet_sim.kernels.log import VALID
from scenarionet_sim.kernels.motion import place_as_recorded
from scenarionet_sim.kernels.paths import height_at, nearest, segment_at

Bool = npt.NDArray[np.bool_]
Codes = npt.NDArray[np.uint8]
Float32 = npt.NDArray[np.float32]
Float64 = npt.NDArray[np.float64]
Int32 = npt.NDArray[np.int32]

HEADWAY, ACCELERATION, DECELERATION, STANDSTILL, SLOWEST, LATERAL, OVERLAP, HARDEST = range(8)
"""Places of the law's numbers in ``law``, see ``policies.Idm``."""

_RED, _YELLOW = 3, 2  # LightColor
_STATIONS = 48
_SPACING = 2.0  # [m] between stations, where they are enough

BX, BY, BZ, COS, SIN, BVX, BVY, HALF_LENGTH, HALF_WIDTH, HALF_HEIGHT, RADIUS = range(11)
"""Columns of the boxes of one world."""


@part
def _boxes(
    w: int, position: Float64, heading: Float64, velocity: Float64, z: Float64, present: Bool, size: Float64
) -> Float64:
    """(11, B) what is present in a world, in the order of the rows."""
    rows = np.flatnonzero(present[w])
    boxes = np.empty((11, len(rows)))
    for b in range(len(rows)):
        n = rows[b]
        boxes[BX, b], boxes[BY, b], boxes[BZ, b] = position[w, n, 0], position[w, n, 1], z[w, n]
        boxes[COS, b], boxes[SIN, b] = np.cos(heading[w, n]), np.sin(heading[w, n])
        boxes[BVX, b], boxes[BVY, b] = velocity[w, n, 0], velocity[w, n, 1]
        for axis in range(3):
            boxes[HALF_LENGTH + axis, b] = size[w, n, axis] / 2.0
        boxes[RADIUS, b] = np.hypot(boxes[HALF_LENGTH, b], boxes[HALF_WIDTH, b])
    return boxes


@part
def _look_ahead(
    points: Float32, arc: Float32, heading: Float32, first: int, end: int, s: float, horizon: float, stations: Float64
) -> int:
    """Writes stations (x, y, arc, heading) from ``s`` to the horizon or the path's end; returns how many."""
    spacing = max(_SPACING, horizon / (_STATIONS - 2))
    k, count, last = segment_at(arc, first, end, s), 0, -np.inf
    stations[0, 0], stations[0, 1], stations[0, 2], stations[0, 3] = _pose_at(points, arc, heading, k, s)
    count, last = 1, s
    for p in range(k + 1, end):
        if arc[p] - last >= spacing or (p == end - 1 and arc[p] > last):
            stations[count, 0], stations[count, 1] = points[p, 0], points[p, 1]
            stations[count, 2], stations[count, 3] = arc[p], heading[p]
            count, last = count + 1, np.float64(arc[p])
            if last > s + horizon or count == _STATIONS:
                break
    return count


@part
def _pose_at(points: Float32, arc: Float32, heading: Float32, k: int, s: float) -> tuple[float, float, float, float]:
    """x, y, s, heading on segment ``k`` of a path."""
    share = (s - arc[k]) / (arc[k + 1] - arc[k])
    turn = _wrapped(np.float64(heading[k + 1]) - np.float64(heading[k]))
    x = points[k, 0] + share * (np.float64(points[k + 1, 0]) - points[k, 0])
    y = points[k, 1] + share * (np.float64(points[k + 1, 1]) - points[k, 1])
    return x, y, s, _wrapped(heading[k] + share * turn)


@part
def _wrapped(angle: float) -> float:
    return float(angle - 2.0 * np.pi * np.floor((angle + np.pi) / (2.0 * np.pi)))


@part
def _braking_for_boxes(boxes: Float64, mine: int, stations: Float64, count: int, speed: float, law: Float64) -> float:
    """The strongest braking that what is on the strip ahead asks for [m/s2]."""
    half_length, half_width = boxes[HALF_LENGTH, mine], boxes[HALF_WIDTH, mine] - law[OVERLAP]
    low_x, high_x = stations[:count, 0].min() - half_width, stations[:count, 0].max() + half_width
    low_y, high_y = stations[:count, 1].min() - half_width, stations[:count, 1].max() + half_width
    braking = 0.0
    for b in range(boxes.shape[1]):
        x, y, radius = boxes[BX, b], boxes[BY, b], boxes[RADIUS, b]
        is_far = x + radius < low_x or x - radius > high_x or y + radius < low_y or y - radius > high_y
        if is_far or b == mine:
            continue
        if abs(boxes[BZ, b] - boxes[BZ, mine]) > boxes[HALF_HEIGHT, b] + boxes[HALF_HEIGHT, mine]:
            continue
        distance, closing = _distance_along(boxes, b, stations, count, half_width)
        if distance < np.inf:
            gap = distance - half_length
            braking = max(
                braking,
                interaction(
                    speed, gap, speed - closing, law[HEADWAY], law[ACCELERATION], law[DECELERATION], law[STANDSTILL]
                ),
            )
    return braking


@part
def _distance_along(boxes: Float64, b: int, stations: Float64, count: int, half_width: float) -> tuple[float, float]:
    """How far along the stations the strip meets box ``b`` [m], infinite if never, and the box's speed along it.

    A box beside or behind the first station, whose middle is not ahead of it, is not met: it follows.
    """
    for k in range(count - 1):
        length = stations[k + 1, 2] - stations[k, 2]
        tx, ty = (stations[k + 1, 0] - stations[k, 0]) / length, (stations[k + 1, 1] - stations[k, 1]) / length
        dx, dy = boxes[BX, b] - stations[k, 0], boxes[BY, b] - stations[k, 1]
        along, left = tx * dx + ty * dy, tx * dy - ty * dx
        radius = boxes[RADIUS, b]
        if abs(left) > half_width + radius or along > length + radius or along < -radius:
            continue
        cos, sin = abs(boxes[COS, b] * tx + boxes[SIN, b] * ty), abs(boxes[COS, b] * ty - boxes[SIN, b] * tx)
        reach_along = cos * boxes[HALF_LENGTH, b] + sin * boxes[HALF_WIDTH, b]
        reach_across = sin * boxes[HALF_LENGTH, b] + cos * boxes[HALF_WIDTH, b]
        is_met = abs(left) < half_width + reach_across and along - reach_along < length and along + reach_along > 0.0
        if is_met and (k > 0 or along > 0.0):
            entered = stations[k, 2] - stations[0, 2] + max(along - reach_along, 0.0 if k > 0 else -np.inf)
            return entered, boxes[BVX, b] * tx + boxes[BVY, b] * ty
    return np.inf, 0.0


@part
def _speed_for_bends(stations: Float64, count: int, law: Float64) -> float:
    """The speed that every bend ahead can still be slowed down for [m/s]."""
    highest = np.inf
    for k in range(count - 1):
        length = stations[k + 1, 2] - stations[k, 2]
        bend = abs(_wrapped(stations[k + 1, 3] - stations[k, 3])) / length
        distance = stations[k, 2] - stations[0, 2]
        if bend > 1e-3:
            highest = min(highest, law[LATERAL] / bend + 2.0 * law[DECELERATION] * distance)
    return float(np.sqrt(highest))


@part
def _braking_for_lights(
    stop_arc: Float32,
    stop_light: Int32,
    first: int,
    end: int,
    light_state: Codes,
    colors: Codes,
    t: int,
    front: float,
    speed: float,
    law: Float64,
) -> float:
    """Braking for the nearest red light ahead, or a yellow one there is still room to stop for [m/s2]."""
    for k in range(first, end):
        gap = stop_arc[k] - front
        color = colors[light_state[stop_light[k], t]]
        if gap < -0.5 or (color != _RED and color != _YELLOW):
            continue
        needed = speed * speed / (2.0 * max(gap, 0.1))
        if needed <= (law[HARDEST] if color == _RED else law[DECELERATION]):
            return float(
                interaction(speed, gap, speed, law[HEADWAY], law[ACCELERATION], law[DECELERATION], law[STANDSTILL])
            )
    return 0.0


@part
def _is_free(x: float, y: float, radius: float, boxes: Float64) -> bool:
    for b in range(boxes.shape[1]):
        if np.hypot(boxes[BX, b] - x, boxes[BY, b] - y) < radius + boxes[HALF_WIDTH, b]:
            return False
    return True


@entry
def drive_along_paths(
    driver: Codes,
    me: int,
    dt: float,
    law: Float64,
    colors: Codes,
    log: Float32,
    num_steps: Int32,
    timestep: Int32,
    points: Float32,
    path_arc: Float32,
    path_heading: Float32,
    path_z: Float32,
    path_offsets: Int32,
    top_speed: Float32,
    stop_arc: Float32,
    stop_light: Int32,
    stop_offsets: Int32,
    light_state: Codes,
    size: Float64,
    position: Float64,
    heading: Float64,
    velocity: Float64,
    yaw_rate: Float64,
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
    """One step of every object that ``me`` drives; arguments as ``Stage`` and ``State`` name them.

    An object appears as recorded, at the first valid timestep at which its place is free, and leaves at the end
    of its path, where its arc length becomes infinite.
    """
    stations = np.empty((_STATIONS, 4))
    for w in range(len(timestep)):
        boxes = _boxes(w, position, heading, velocity, z, present, size)
        t, mine = timestep[w] + 1, -1
        for n in range(driver.shape[1]):
            mine += present[w, n]
            if driver[w, n] != me:
                continue
            first, end, s = path_offsets[w, n], path_offsets[w, n + 1], arc[w, n]
            next_arc[w, n], next_lateral[w, n], next_present[w, n] = s, 0.0, False
            if s == np.inf:
                continue
            if not present[w, n]:
                if t < num_steps[w] and log[w, t, n, VALID] != 0.0:
                    row = log[w, t, n]
                    if _is_free(np.float64(row[0]), np.float64(row[1]), size[w, n, 1] / 2.0, boxes):
                        place_as_recorded(
                            row, w, n, next_position, next_heading, next_velocity, next_yaw_rate, next_z, next_present
                        )
                continue
            if np.isnan(s):
                s, _ = nearest(
                    points[w], path_arc[w], path_heading[w], first, end,
                    position[w, n, 0], position[w, n, 1], -np.inf, np.inf,
                )  # fmt: skip
                s = max(s, 0.0)
            speed = np.hypot(velocity[w, n, 0], velocity[w, n, 1])
            horizon = 10.0 + size[w, n, 0] + speed * law[HEADWAY] + speed * speed / (2.0 * law[DECELERATION])
            count = _look_ahead(points[w], path_arc[w], path_heading[w], first, end, s, horizon, stations)
            desired = min(max(np.float64(top_speed[w, n]), law[SLOWEST]), _speed_for_bends(stations, count, law))
            braking = _braking_for_boxes(boxes, mine, stations, count, speed, law)
            if stop_offsets[w, n + 1] > stop_offsets[w, n]:
                braking = max(
                    braking,
                    _braking_for_lights(
                        stop_arc[w], stop_light[w], stop_offsets[w, n], stop_offsets[w, n + 1], light_state[w], colors,
                        min(timestep[w], num_steps[w] - 1), s + size[w, n, 0] / 2.0, speed, law,
                    ),
                )  # fmt: skip
            wanted = free_acceleration(speed, desired, law[ACCELERATION], law[DECELERATION]) - braking
            new_speed = max(speed + max(wanted, -law[HARDEST]) * dt, 0.0)
            s += (speed + new_speed) / 2.0 * dt
            if s >= path_arc[w, end - 1]:
                next_arc[w, n] = np.inf
                continue
            k = segment_at(path_arc[w], first, end, s)
            x, y, _, angle = _pose_at(points[w], path_arc[w], path_heading[w], k, s)
            length = path_arc[w, k + 1] - path_arc[w, k]
            next_position[w, n, 0], next_position[w, n, 1], next_heading[w, n] = x, y, angle
            next_velocity[w, n, 0] = new_speed * (points[w, k + 1, 0] - points[w, k, 0]) / length
            next_velocity[w, n, 1] = new_speed * (points[w, k + 1, 1] - points[w, k, 1]) / length
            next_yaw_rate[w, n] = _wrapped(angle - heading[w, n]) / dt
            next_z[w, n] = height_at(path_arc[w], path_z[w], first, end, s)
            next_arc[w, n], next_present[w, n] = s, True
