"""Ray casting in the plane, at boxes of objects.

Rays start at the agent's centre and turn with it: ray k has the direction ``directions[k]`` in the agent's frame
(x forward, y left), at the angle 2 pi k / R. The output is the distance divided by the range: 0 inside a box, 1 without
a hit.

The side of a box on the line n p = c is met in direction d at 1 / t = (n / c) d, so that reciprocals of distances cost
no quotient per ray. Of the one or two sides that face the agent, a ray between the outermost corners meets the farther.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from scenarionet_data.arrays.dtypes import Float32, Float64, Int32
from scenarionet_data.compiled.decorators import device_function
from scenarionet_sim.arrays.boxes import HALF_LENGTH, HALF_WIDTH, RADIUS, Boxes, X, Y, rotation
from scenarionet_sim.arrays.log import HEADING
from scenarionet_sim.arrays.minmax import larger, smaller
from scenarionet_sim.arrays.structures import StateArrays
from scenarionet_sim.roads.ray_kernels import RayFan

_ANGLE_ERROR = 2e-5
"""Largest error of :func:`_angle` [rad], and as much again."""

_TINY = 1e-30
"""Substitute for the distance from a side that does not face the agent."""


_Two = tuple[Int32, Int32]
_Four = tuple[Float64, Float64, Float64, Float64]


class RayMemory(NamedTuple):
    """Memory for the rays of one agent.

    Attributes:
        nearness: (R,) range divided by the distance, at least 1.
        near: (6, N) boxes in range: offset from the agent x, y [m]; cosine and sine of the heading; half of length and
            width [m].
        sides: (4, N) the two sides that face the agent, as vectors a and b in its frame: their product with the
            direction of a ray is the range divided by the distance. Both are 0 if the agent is inside.
        rays: (2, N) first and last ray that meet it, from 0 on; the last ray is followed by 0.
    """

    nearness: Float64
    near: Float64
    sides: Float64
    rays: Int32

    @classmethod
    def of(cls, num_rays: int, num_objects: int) -> RayMemory:
        """Allocate the memory."""
        near, sides = np.empty((6, num_objects)), np.empty((4, num_objects))
        return cls(np.empty(num_rays), near, sides, np.empty((2, num_objects), np.int32))


@device_function(divides_by_zero=True)
def ranges_to_boxes(
    w: int, own: int, now: StateArrays, boxes: Boxes, rays: RayFan, memory: RayMemory, out: Float32
) -> None:
    """Cast the rays of one agent at the other boxes of its world.

    Boxes pass one loop after another, as the processor computes several at once only where it foresees all branches.

    Args:
        w, own: World and row of the agent.
        now: Current state.
        boxes: Boxes of its world.
        rays: Evenly spread from straight ahead, counter-clockwise.
        memory: Written.
        out: (R,) output.
    """
    motion, directions, reach = now.motion[w], rays.directions, rays.reach
    me, numbers, near, sides, found, seen = motion[own], boxes.numbers, memory.near, memory.sides, memory.rays, 0
    for b in range(boxes.num_boxes[0]):
        dx, dy, far = numbers[X, b] - me[X], numbers[Y, b] - me[Y], reach + numbers[RADIUS, b]
        row = boxes.row[b]
        if dx * dx + dy * dy < far * far and row != own and rays.types[now.object_type[w, row]]:
            near[0, seen], near[1, seen] = dx, dy
            near[2, seen], near[3, seen] = rotation(b, motion, boxes)
            near[4, seen], near[5, seen] = numbers[HALF_LENGTH, b], numbers[HALF_WIDTH, b]
            seen += 1
    axis, facing = (np.cos(me[HEADING]), np.sin(me[HEADING])), (sides[0], sides[1], sides[2], sides[3])
    _face(seen, axis, near, directions, reach, facing, (found[0], found[1]))
    num_rays, nearness = len(directions), memory.nearness
    for ray in range(num_rays):
        nearness[ray] = 1.0
    for place in range(seen):
        ax, ay, bx, by = sides[0, place], sides[1, place], sides[2, place], sides[3, place]
        if ax == 0.0 and ay == 0.0:
            for ray in range(num_rays):
                nearness[ray] = np.inf
        for ray in range(found[0, place], found[1, place] + 1):
            k = ray if ray < num_rays else ray - num_rays
            dx, dy = directions[k, 0], directions[k, 1]
            nearness[k] = larger(nearness[k], smaller(ax * dx + ay * dy, bx * dx + by * dy))
    for ray in range(num_rays):
        out[ray] = 1.0 / nearness[ray]


@device_function(divides_by_zero=True, in_lanes=True)
def _face(
    count: int, axis: tuple[float, float], near: Float64, directions: Float64, reach: float, sides: _Four, found: _Two
) -> None:
    """Find the sides of boxes that face an agent of that axis, and the rays that meet them; see ``RayMemory``."""
    (cos_me, sin_me), (a_x, a_y, b_x, b_y), (first, last) = axis, sides, found
    for k in range(count):
        dx, dy, half_x, half_y = near[0, k], near[1, k], near[4, k], near[5, k]
        # Cosine and sine of the box, and the agent in the frame of the box.
        cos_box, sin_box = near[2, k], near[3, k]
        cos, sin = cos_me * cos_box + sin_me * sin_box, cos_me * sin_box - sin_me * cos_box
        x, y = -(cos_box * dx + sin_box * dy), sin_box * dx - cos_box * dy
        # 1 or -1 for a side that faces the agent, which it sees alone where the other is 0.
        side_x = np.float64(abs(x) > half_x) * np.copysign(1.0, x)
        side_y = np.float64(abs(y) > half_y) * np.copysign(1.0, y)
        alone_x, alone_y = side_x * (1.0 - side_y * side_y), side_y * (1.0 - side_x * side_x)
        # The outermost corners at the right and left, as the agent sees the box.
        right_x, right_y = (alone_x - side_y) * half_x - x, (alone_y + side_x) * half_y - y
        left_x, left_y = (alone_x + side_y) * half_x - x, (alone_y - side_x) * half_y - y
        right_x, right_y = cos * right_x - sin * right_y, sin * right_x + cos * right_y
        left_x, left_y = cos * left_x - sin * left_y, sin * left_x + cos * left_y
        first[k], last[k] = _rays_between(right_x, right_y, left_x, left_y, directions)
        over_x = -side_x * reach / larger(abs(x) - half_x, _TINY)
        over_y = -side_y * reach / larger(abs(y) - half_y, _TINY)
        ax, ay, bx, by = over_x * cos, over_x * sin, -over_y * sin, over_y * cos
        a_x[k], a_y[k] = ax + (1.0 - side_x * side_x) * bx, ay + (1.0 - side_x * side_x) * by
        b_x[k], b_y[k] = bx + (1.0 - side_y * side_y) * ax, by + (1.0 - side_y * side_y) * ay


@device_function(forceinline=True, divides_by_zero=True, in_lanes=True)
def _rays_between(right_x: float, right_y: float, left_x: float, left_y: float, directions: Float64) -> tuple[int, int]:
    """Return the first and last ray from a point to another one on its left, by the angles and then the directions."""
    rays, per_radian = len(directions), len(directions) / (2.0 * np.pi)
    begin, end = _angle(right_x, right_y), _angle(left_x, left_y)
    end += 2.0 * np.pi if end < begin - 1.0 else 0.0
    first = int(np.ceil((begin - _ANGLE_ERROR) * per_radian))
    last = int(np.floor((end + _ANGLE_ERROR) * per_radian))
    before = rays if first < 0 else 0
    first, last = first + before, last + before
    k, m = first if first < rays else first - rays, last if last < rays else last - rays
    first += directions[k, 0] * right_y - directions[k, 1] * right_x > 0.0
    last -= directions[m, 0] * left_y - directions[m, 1] * left_x < 0.0
    return first, last


@device_function(forceinline=True, divides_by_zero=True, in_lanes=True)
def _angle(x: float, y: float) -> float:
    """Return the direction of a vector up to 1e-5 rad, four times as fast as the exact arctangent; finite for any.

    Source: M. Abramowitz, I. Stegun, "Handbook of Mathematical Functions", 4.4.49.
    """
    wide, high = abs(x), abs(y)
    t = larger(smaller(wide, high) / larger(wide, high), 0.0)  # 0 also where that is 0 / 0
    u = t * t
    angle = t * (0.9998660 + u * (-0.3302995 + u * (0.1801410 + u * (-0.0851330 + u * 0.0208351))))
    angle = np.pi / 2.0 - angle if high > wide else angle
    angle = np.pi - angle if x < 0.0 else angle
    return -angle if y < 0.0 else angle
