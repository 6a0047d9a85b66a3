"""Pixels of a tile: their rays, and whether a triangle, the ground or the sky is seen along them."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from scenarionet_data.arrays.dtypes import Float32, Float64, Int32
from scenarionet_data.compiled.decorators import device_function
from scenarionet_sim.arrays.minmax import larger, smaller
from scenarionet_sim.cameras.draw import codes
from scenarionet_sim.cameras.draw import columns as at
from scenarionet_sim.cameras.draw.ground import meet_heights
from scenarionet_sim.cameras.draw.single_precision import single, single_of
from scenarionet_sim.cameras.draw.structures import LANES, FrameView, Ground, Tile

_GROUND, _SKY, _TRIANGLE = np.int32(codes.SEES_GROUND), np.int32(codes.SEES_SKY), np.int32(codes.SEES_TRIANGLE)
_ON_GROUND, _NOTHING = np.int32(codes.ON_GROUND), np.int32(codes.NOTHING)


class Rays(NamedTuple):
    """Rays of a tile and what is seen along them: the rows of ``FrameMemory.shades`` of these names."""

    ray_x: Float32
    ray_y: Float32
    ray_z: Float32
    far: Float32
    distance: Float32
    ground_x: Float32
    ground_y: Float32


@device_function(forceinline=True, divides_by_zero=True)
def look_along(first: int, view: FrameView, ground: Ground, tile: Tile) -> int:
    """Write the rays of a tile, how far its pixels see, what, and where that is; return the kinds of what is seen.

    Args:
        first: Number of the first pixel in the picture.
        view, ground: The camera and the ground.
        tile: Memory of the tile, with the nearest triangles.
    """
    slot, pose, width, shades, count = view.slot, view.pose, view.width, tile.shades, len(tile.seen)
    rays = Rays(
        shades[at.RAY_X], shades[at.RAY_Y], shades[at.RAY_Z], shades[at.FAR], shades[at.DISTANCE],
        shades[at.GROUND_X], shades[at.GROUND_Y],
    )  # fmt: skip
    inverse = 1.0 / (ground.level[slot] - pose[at.EYE + 2])
    begin, row, column = 0, first // width, first % width
    while begin < count:
        end = smaller(begin + width - column, count)
        aim_rays(row, column, begin, end, view, inverse, rays)
        begin, row, column = end, row + 1, 0
    if ground.height_frame[slot, 3] > 0.0:
        eye = pose[at.EYE], pose[at.EYE + 1], pose[at.EYE + 2]
        for k in range(count):
            ray = rays.ray_x[k] * 1.0, rays.ray_y[k] * 1.0, rays.ray_z[k] * 1.0
            rays.distance[k] = 1.0 / meet_heights(ground, slot, eye, ray, view.reach)
    frame = ground.frame[slot]
    start = pose[at.EYE] - frame[0], pose[at.EYE + 1] - frame[1]
    return _choose_nearest(count, view.reach, start, tile.near, tile.seen, rays)


@device_function(divides_by_zero=True)
def aim_rays(row: int, start: int, first: int, end: int, view: FrameView, inverse: float, rays: Rays) -> None:
    """Write rays of a tile, of pixels of a row from column ``start`` on; those after ``end`` are written next.

    Args:
        row, start: The first pixel.
        first, end: Where to write in the tile.
        view: The camera.
        inverse: Inverse of the height of level ground over the camera [1/m].
        rays: Output: ``far`` has the squares of the rays' lengths afterwards, ``distance`` the inverse distances to
            level ground.
    """
    lens = view.lens
    if lens[at.KIND] == codes.PINHOLE:
        v, step = (row + 0.5 - lens[at.CY]) / lens[at.FY], 1.0 / lens[at.FX]
        stop = smaller(first + (end - first + LANES - 1) // LANES * LANES, len(rays.far))
        _aim_straight(first, stop, (start - first + 0.5 - lens[at.CX]) * step, step, v, view.pose, inverse, rays)
    else:
        _aim_by_table(first, end, start - first, view.pose, view.rays[row], inverse, rays)


@device_function(divides_by_zero=True, in_lanes=True)
def _aim_straight(
    first: int, end: int, left: float, step: float, v: float, pose: Float64, inverse: float, rays: Rays
) -> None:
    """Write rays of a pinhole.

    Their rise, which nearly vanishes at the horizon, is the sum of two numbers of 4 bytes: the second one has what is
    left of start and step when the first one is rounded.
    """
    xs, ys, zs, squares, distances = rays.ray_x, rays.ray_y, rays.ray_z, rays.far, rays.distance
    rx, ry, u_step = single(pose[at.RIGHT]), single(pose[at.RIGHT + 1]), single(step)
    bz, z_step = v * pose[at.DOWN + 2] + pose[at.FORWARD + 2] + left * pose[at.RIGHT + 2], step * pose[at.RIGHT + 2]
    near_z, near_step = single(bz), single(z_step)
    rest_z, rest_step = single(bz - near_z), single(z_step - near_step)
    bx, by = single(v * pose[at.DOWN] + pose[at.FORWARD]), single(v * pose[at.DOWN + 1] + pose[at.FORWARD + 1])
    start, rest, per_rise = single(left), single(v) * single(v) + 1.0, single(inverse)
    for k in range(first, end):
        step_k = single_of(k)
        u, z = start + u_step * step_k, (near_z + near_step * step_k) + (rest_z + rest_step * step_k)
        xs[k], ys[k], zs[k], squares[k], distances[k] = u * rx + bx, u * ry + by, z, u * u + rest, z * per_rise


@device_function(divides_by_zero=True, in_lanes=True)
def _aim_by_table(
    first: int, end: int, shift: int, pose: Float64, directions: Float64, inverse: float, rays: Rays
) -> None:
    """Write rays of other lenses, by their directions (W, 3) before the camera."""
    xs, ys, zs, squares, distances = rays.ray_x, rays.ray_y, rays.ray_z, rays.far, rays.distance
    for k in range(first, end):
        x, y, z = directions[k + shift, 0], directions[k + shift, 1], directions[k + shift, 2]
        up = x * pose[at.RIGHT + 2] + y * pose[at.DOWN + 2] + z * pose[at.FORWARD + 2]
        xs[k] = x * pose[at.RIGHT] + y * pose[at.DOWN] + z * pose[at.FORWARD]
        ys[k] = x * pose[at.RIGHT + 1] + y * pose[at.DOWN + 1] + z * pose[at.FORWARD + 1]
        zs[k], distances[k], squares[k] = up, up * inverse, x * x + y * y + z * z


@device_function(divides_by_zero=True, in_lanes=True)
def _choose_nearest(count: int, reach: float, eye: tuple[float, float], near: Float32, seen: Int32, rays: Rays) -> int:
    """Replace the inverse distances to the ground by the distances to what is seen; write what that is, and where.

    Distances are in lengths of rays in ``distance``, in metres in ``far``; places are in the frame of the ground's
    grid.
    """
    distances, far, xs, ys = rays.distance, rays.far, rays.ground_x, rays.ground_y
    kinds = np.int32(0)
    x, y, most = single(eye[0]), single(eye[1]), single(reach)
    for k in range(count):
        length, to_ground = math.sqrt(far[k]), larger(distances[k], 0.0)
        to_ground = to_ground if length < most * to_ground else 0.0
        nearest = larger(near[k], to_ground)
        is_triangle = (near[k] >= to_ground) & (seen[k] >= 0)
        kinds = np.int32(kinds | (_TRIANGLE if is_triangle else (_GROUND if to_ground > 0.0 else _SKY)))
        seen[k] = seen[k] if is_triangle else (_ON_GROUND if to_ground > 0.0 else _NOTHING)
        distance = 1.0 / nearest if nearest > 0.0 else most
        distances[k], far[k] = distance, distance * length
        xs[k], ys[k] = x + distance * rays.ray_x[k], y + distance * rays.ray_y[k]
    return int(kinds)
