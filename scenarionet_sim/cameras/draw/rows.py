"""Pixels of a tile: their rays, and whether a triangle, the ground or the sky is seen along them."""

from __future__ import annotations

import math

import numpy as np

from scenarionet_data.arrays.dtypes import Float32, Float64, Int32
from scenarionet_data.compiled.decorators import device_function
from scenarionet_sim.arrays.minmax import larger, smaller
from scenarionet_sim.cameras.draw.ground import meet_heights
from scenarionet_sim.cameras.draw.layout import (
    CX,
    CY,
    DISTANCE,
    DOWN,
    EYE,
    FAR,
    FORWARD,
    FX,
    FY,
    GROUND_X,
    GROUND_Y,
    KIND,
    LANES,
    NOTHING,
    ON_GROUND,
    PINHOLE,
    RAY_X,
    RAY_Y,
    RAY_Z,
    RIGHT,
    SEES_GROUND,
    SEES_SKY,
    SEES_TRIANGLE,
    Ground,
)
from scenarionet_sim.cameras.draw.singles import single, single_of

_GROUND, _SKY, _TRIANGLE = np.int32(SEES_GROUND), np.int32(SEES_SKY), np.int32(SEES_TRIANGLE)
_ON_GROUND, _NOTHING = np.int32(ON_GROUND), np.int32(NOTHING)


@device_function(forceinline=True, divides_by_zero=True)
def look_along(
    first: int, count: int, slot: int, pose: Float64, lens: Float64, rays: Float64, width: int, reach: float,
    ground: Ground, near: Float32, seen: Int32, shades: Float32,
) -> int:  # fmt: skip
    """Write the rays of a tile, how far its pixels see, what, and where that is; return the kinds of what is seen.

    Args:
        first, count: Number of the first pixel in the picture, and of pixels.
        slot: World.
        pose, lens, rays: The camera.
        width: Of the picture.
        reach: Farthest visible distance along a ray [m].
        ground: The ground.
        near, seen: Inverse distance and number of the nearest triangle, see ``FrameMemory``; what is seen is written
            to ``seen``.
        shades: Memory of the tile.
    """
    has_heights = ground.height_frame[slot, 3] > 0.0
    inverse = 1.0 / (ground.level[slot] - pose[EYE + 2])
    begin, row, column = 0, first // width, first % width
    while begin < count:
        end = smaller(begin + width - column, count)
        aim_rays(row, column, begin, end, pose, lens, rays, inverse, shades)
        begin, row, column = end, row + 1, 0
    ray_x, ray_y, ray_z, distances = shades[RAY_X], shades[RAY_Y], shades[RAY_Z], shades[DISTANCE]
    if has_heights:
        for k in range(count):
            distances[k] = 1.0 / meet_heights(
                ground, slot, pose[EYE], pose[EYE + 1], pose[EYE + 2], ray_x[k] * 1.0, ray_y[k] * 1.0, ray_z[k] * 1.0,
                reach,
            )  # fmt: skip
    frame = ground.frame[slot]
    return _choose_nearest(
        count, reach, pose[EYE] - frame[0], pose[EYE + 1] - frame[1], near, ray_x, ray_y, seen, distances, shades[FAR],
        shades[GROUND_X], shades[GROUND_Y],
    )  # fmt: skip


@device_function(divides_by_zero=True)
def aim_rays(
    row: int, start: int, first: int, end: int, pose: Float64, lens: Float64, rays: Float64, inverse: float,
    shades: Float32,
) -> None:  # fmt: skip
    """Write rays of a tile, of pixels of a row from column ``start`` on; those after ``end`` are written next.

    Args:
        row, start: The first pixel.
        first, end: Where to write in the tile.
        pose, lens, rays: The camera.
        inverse: Inverse of the height of level ground over the camera [1/m].
        shades: Memory of the tile: ``FAR`` has the squares of the rays' lengths afterwards, ``DISTANCE`` the inverse
            distances to level ground.
    """
    xs, ys, zs, squares, distances = shades[RAY_X], shades[RAY_Y], shades[RAY_Z], shades[FAR], shades[DISTANCE]
    if lens[KIND] == PINHOLE:
        v, step = (row + 0.5 - lens[CY]) / lens[FY], 1.0 / lens[FX]
        stop = smaller(first + (end - first + LANES - 1) // LANES * LANES, len(xs))
        _aim_straight(
            first, stop, (start - first + 0.5 - lens[CX]) * step, step, v, pose, inverse, xs, ys, zs, squares, distances
        )
    else:
        _aim_by_table(first, end, start - first, pose, rays[row], inverse, xs, ys, zs, squares, distances)


@device_function(divides_by_zero=True, in_lanes=True)
def _aim_straight(
    first: int, end: int, left: float, step: float, v: float, pose: Float64, inverse: float, xs: Float32, ys: Float32,
    zs: Float32, squares: Float32, distances: Float32,
) -> None:  # fmt: skip
    """Write rays of a pinhole.

    Their rise, which nearly vanishes at the horizon, is the sum of two numbers of 4 bytes: the second one has what is
    left of start and step when the first one is rounded.
    """
    rx, ry, u_step = single(pose[RIGHT]), single(pose[RIGHT + 1]), single(step)
    bz, z_step = v * pose[DOWN + 2] + pose[FORWARD + 2] + left * pose[RIGHT + 2], step * pose[RIGHT + 2]
    near_z, near_step = single(bz), single(z_step)
    rest_z, rest_step = single(bz - near_z), single(z_step - near_step)
    bx, by = single(v * pose[DOWN] + pose[FORWARD]), single(v * pose[DOWN + 1] + pose[FORWARD + 1])
    start, rest, per_rise = single(left), single(v) * single(v) + 1.0, single(inverse)
    for k in range(first, end):
        at = single_of(k)
        u, z = start + u_step * at, (near_z + near_step * at) + (rest_z + rest_step * at)
        xs[k], ys[k], zs[k], squares[k], distances[k] = u * rx + bx, u * ry + by, z, u * u + rest, z * per_rise


@device_function(divides_by_zero=True, in_lanes=True)
def _aim_by_table(
    first: int, end: int, shift: int, pose: Float64, rays: Float64, inverse: float, xs: Float32, ys: Float32,
    zs: Float32, squares: Float32, distances: Float32,
) -> None:  # fmt: skip
    """Write rays of other lenses, by their directions (W, 3) before the camera."""
    for k in range(first, end):
        x, y, z = rays[k + shift, 0], rays[k + shift, 1], rays[k + shift, 2]
        up = x * pose[RIGHT + 2] + y * pose[DOWN + 2] + z * pose[FORWARD + 2]
        xs[k] = x * pose[RIGHT] + y * pose[DOWN] + z * pose[FORWARD]
        ys[k] = x * pose[RIGHT + 1] + y * pose[DOWN + 1] + z * pose[FORWARD + 1]
        zs[k], distances[k], squares[k] = up, up * inverse, x * x + y * y + z * z


@device_function(divides_by_zero=True, in_lanes=True)
def _choose_nearest(
    count: int, reach: float, eye_x: float, eye_y: float, near: Float32, ray_x: Float32, ray_y: Float32, seen: Int32,
    distances: Float32, far: Float32, xs: Float32, ys: Float32,
) -> int:  # fmt: skip
    """Replace the inverse distances to the ground by the distances to what is seen; write what that is, and where.

    Distances are in lengths of rays in ``distances``, in metres in ``far``; places are in the frame of the ground's
    grid.
    """
    kinds = np.int32(0)
    x, y, most = single(eye_x), single(eye_y), single(reach)
    for k in range(count):
        length, to_ground = math.sqrt(far[k]), larger(distances[k], 0.0)
        to_ground = to_ground if length < most * to_ground else 0.0
        nearest = larger(near[k], to_ground)
        is_triangle = (near[k] >= to_ground) & (seen[k] >= 0)
        kinds = np.int32(kinds | (_TRIANGLE if is_triangle else (_GROUND if to_ground > 0.0 else _SKY)))
        seen[k] = seen[k] if is_triangle else (_ON_GROUND if to_ground > 0.0 else _NOTHING)
        distance = 1.0 / nearest if nearest > 0.0 else most
        distances[k], far[k] = distance, distance * length
        xs[k], ys[k] = x + distance * ray_x[k], y + distance * ray_y[k]
    return int(kinds)
