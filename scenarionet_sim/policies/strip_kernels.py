"""The strip that a vehicle will sweep along its path, and the boxes on it.

Most boxes are far from the strip, and most of the others from most of its parts. Circles and rectangles around them
tell so in a few operations.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from scenarionet_data.arrays.dtypes import Bool, Float64
from scenarionet_data.compiled.decorators import device_function
from scenarionet_sim.arrays.boxes import HALF_LENGTH, HALF_WIDTH, RADIUS, Boxes, rotation
from scenarionet_sim.arrays.boxes import X as BOX_X
from scenarionet_sim.arrays.boxes import Y as BOX_Y
from scenarionet_sim.arrays.log import ARC, HEADING, VX, VY, X, Y
from scenarionet_sim.arrays.minmax import larger, smaller
from scenarionet_sim.worlds.path_kernels import PathRows, pose_on


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


_STATIONS = 64
_SPACING, _COARSER = 2.0, 1.0 / 12.0  # least distance between stations [m], and its growth with the distance ahead
_X, _Y, STATION_ARC, STATION_HEADING, _MIDDLE_X, _MIDDLE_Y, _HALF = range(7)  # columns of stations


@device_function
def look_ahead(path: PathRows, k: int, s: float, stations: Float64) -> int:
    """Write stations from ``s``, on segment ``k``, to the end of the path; return their number.

    The law has no horizon: cutting it off would let the acceleration jump when a leader comes into view. Stations are
    wider apart with the distance, so that they reach over a kilometre.
    """
    stations[0, _X], stations[0, _Y], _, stations[0, STATION_HEADING] = pose_on(path, k, s)
    stations[0, STATION_ARC] = s
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
        station[_X], station[_Y] = points[k, X], points[k, Y]
        station[STATION_ARC], station[STATION_HEADING] = points[k, ARC], points[k, HEADING]
        count, last = count + 1, np.float64(points[k, ARC])
        spacing = larger(_SPACING, (last - s) * _COARSER)
    return count


@device_function
def find_near(memory: SightMemory, count: int, half_width: float) -> None:
    """Write the parts of the strip between ``count`` stations, and the boxes near a rectangle around all of them."""
    boxes, stations = memory.boxes.numbers, memory.stations
    low_x, high_x, low_y, high_y = np.inf, -np.inf, np.inf, -np.inf
    for k in range(count):
        x, y, following = stations[k, _X], stations[k, _Y], stations[smaller(k + 1, count - 1)]
        low_x, high_x, low_y, high_y = smaller(low_x, x), larger(high_x, x), smaller(low_y, y), larger(high_y, y)
        tx, ty = following[_X] - x, following[_Y] - y
        stations[k, _MIDDLE_X], stations[k, _MIDDLE_Y] = x + 0.5 * tx, y + 0.5 * ty
        stations[k, _HALF] = 0.5 * np.sqrt(tx * tx + ty * ty)
    middle = 0.5 * (low_x + high_x), 0.5 * (low_y + high_y)
    reach = 0.5 * (high_x - low_x) + half_width, 0.5 * (high_y - low_y) + half_width
    circles = boxes[BOX_X], boxes[BOX_Y], boxes[RADIUS]
    _mark_near(memory.boxes.num_boxes[0], middle, reach, circles, memory.is_near)


@device_function(in_lanes=True)
def _mark_near(
    count: int,
    middle: tuple[float, float],
    reach: tuple[float, float],
    circles: tuple[Float64, Float64, Float64],
    is_near: Bool,
) -> None:
    """Mark the circles (x, y and radius) that may meet a rectangle."""
    (x, y), (reach_x, reach_y), (box_x, box_y, radius) = middle, reach, circles
    for b in range(count):
        is_near[b] = (abs(box_x[b] - x) <= reach_x + radius[b]) & (abs(box_y[b] - y) <= reach_y + radius[b])


@device_function
def meet(motion: Float64, memory: SightMemory, b: int, count: int, half_width: float) -> tuple[float, float]:
    """Return the distance along the stations to box ``b`` [m], infinite if not on the strip, and its speed along it.

    A box whose centre is not ahead of the first station is a follower and does not count.
    """
    numbers, stations = memory.boxes.numbers, memory.stations
    box_x, box_y, radius = numbers[BOX_X, b], numbers[BOX_Y, b], numbers[RADIUS, b]
    half_length, half_width_b, widest = numbers[HALF_LENGTH, b], numbers[HALF_WIDTH, b], half_width + radius
    for k in range(count - 1):
        station = stations[k]
        x, y, reach = box_x - station[_MIDDLE_X], box_y - station[_MIDDLE_Y], station[_HALF] + radius + widest
        if x * x + y * y > reach * reach:
            continue
        dx, dy = box_x - station[_X], box_y - station[_Y]
        tx, ty = stations[k + 1, _X] - station[_X], stations[k + 1, _Y] - station[_Y]
        left, squared = tx * dy - ty * dx, tx * tx + ty * ty
        if left * left > widest * widest * squared:
            continue
        length = larger(np.sqrt(squared), 1e-9)  # shorter than the arc where the path is noisy
        tx, ty = tx / length, ty / length
        along, left = tx * dx + ty * dy, tx * dy - ty * dx
        cos_b, sin_b = rotation(b, motion, memory.boxes)
        cos, sin = abs(cos_b * tx + sin_b * ty), abs(cos_b * ty - sin_b * tx)
        reach, across = cos * half_length + sin * half_width_b, sin * half_length + cos * half_width_b
        if abs(left) >= half_width + across or along - reach >= length or along + reach <= 0.0:
            continue
        if k > 0 or along > 0.0:
            entered = along - reach if k == 0 else larger(along - reach, 0.0)
            other = motion[memory.boxes.row[b]]
            return station[STATION_ARC] - stations[0, STATION_ARC] + entered, other[VX] * tx + other[VY] * ty
    return np.inf, 0.0
