"""Pixels of a tile: their rays, and whether a triangle, the ground or the sky is seen along them."""

from __future__ import annotations

import math

import numpy as np

from scenarionet_data.arrays.compiled import device_function
from scenarionet_data.arrays.dtypes import Float32, Float64, Int32
from scenarionet_sim.kernels.cameras.ground import meet_heights
from scenarionet_sim.kernels.cameras.layout import (
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
    NOTHING,
    ON_GROUND,
    PINHOLE,
    RAY_X,
    RAY_Y,
    RAY_Z,
    RIGHT,
    SQUARE,
    Ground,
)
from scenarionet_sim.kernels.cameras.singles import single
from scenarionet_sim.kernels.minmax import larger


@device_function(divides_by_zero=True)
def aim_rays(
    row: int, start: int, first: int, end: int, pose: Float64, lens: Float64, rays: Float64, exact: Float64
) -> None:
    """Write rays of a tile, of pixels of a row from column ``start`` on, and the squares of their lengths."""
    xs, ys, zs = exact[RAY_X, first:end], exact[RAY_Y, first:end], exact[RAY_Z, first:end]
    squares = exact[SQUARE, first:end]
    if lens[KIND] == PINHOLE:
        v, step = (row + 0.5 - lens[CY]) / lens[FY], 1.0 / lens[FX]
        _aim_straight((start + 0.5 - lens[CX]) * step, step, v, pose, xs, ys, zs, squares)
        return
    for k in range(len(xs)):
        x, y, z = rays[row, start + k, 0], rays[row, start + k, 1], rays[row, start + k, 2]
        xs[k] = x * pose[RIGHT] + y * pose[DOWN] + z * pose[FORWARD]
        ys[k] = x * pose[RIGHT + 1] + y * pose[DOWN + 1] + z * pose[FORWARD + 1]
        zs[k] = x * pose[RIGHT + 2] + y * pose[DOWN + 2] + z * pose[FORWARD + 2]
        squares[k] = x * x + y * y + z * z


@device_function(divides_by_zero=True, in_lanes=True)
def _aim_straight(
    first: float, step: float, v: float, pose: Float64, xs: Float64, ys: Float64, zs: Float64, squares: Float64
) -> None:
    rx, ry, rz = pose[RIGHT], pose[RIGHT + 1], pose[RIGHT + 2]
    bx, by = v * pose[DOWN] + pose[FORWARD], v * pose[DOWN + 1] + pose[FORWARD + 1]
    bz = v * pose[DOWN + 2] + pose[FORWARD + 2]
    rest = v * v + 1.0
    for k in range(len(xs)):
        u = first + step * k
        xs[k], ys[k], zs[k], squares[k] = u * rx + bx, u * ry + by, u * rz + bz, u * u + rest


@device_function(divides_by_zero=True)
def meet_ground(
    count: int, slot: int, pose: Float64, reach: float, ground: Ground, near: Float64, seen: Int32, exact: Float64
) -> None:
    """Write how far the pixels of a tile see, and what: the nearer of ground and triangle."""
    ez = pose[EYE + 2]
    zs, distances = exact[RAY_Z], exact[DISTANCE]
    if ground.height_frame[slot, 3] > 0.0:
        for k in range(count):
            distances[k] = 1.0 / meet_heights(
                ground, slot, pose[EYE], pose[EYE + 1], ez, exact[RAY_X, k], exact[RAY_Y, k], zs[k], reach
            )
    else:
        _meet_level(count, 1.0 / (ground.level[slot] - ez), zs, distances)
    _choose_nearest(count, reach, exact[SQUARE], near, seen, distances)


@device_function(divides_by_zero=True, in_lanes=True)
def _meet_level(count: int, inverse: float, zs: Float64, distances: Float64) -> None:
    """Write the inverse distances at which rays meet level ground."""
    for k in range(count):
        distances[k] = zs[k] * inverse


@device_function(divides_by_zero=True, in_lanes=True)
def _choose_nearest(count: int, reach: float, squares: Float64, near: Float64, seen: Int32, distances: Float64) -> None:
    """Replace the inverse distances to the ground by the distances to what is seen; write what that is."""
    most = reach * reach
    for k in range(count):
        to_ground = larger(distances[k], 0.0)
        to_ground = to_ground if squares[k] < most * to_ground * to_ground else 0.0
        nearest = larger(near[k], to_ground)
        before = seen[k]
        is_triangle = (near[k] >= to_ground) & (before >= 0)
        seen[k] = before if is_triangle else np.int32(ON_GROUND if to_ground > 0.0 else NOTHING)
        distances[k] = 1.0 / nearest if nearest > 0.0 else reach


@device_function(divides_by_zero=True)
def place_points(count: int, pose: Float64, frame: Float64, exact: Float64, shades: Float32) -> None:
    """Write the distances of what the pixels of a tile see, and its places in the frame of the ground's grid."""
    _place_points(
        count, pose[EYE] - frame[0], pose[EYE + 1] - frame[1], exact[DISTANCE], exact[RAY_X], exact[RAY_Y],
        exact[SQUARE], shades[FAR], shades[GROUND_X], shades[GROUND_Y],
    )  # fmt: skip


@device_function(divides_by_zero=True, in_lanes=True)
def _place_points(
    count: int, x: float, y: float, distances: Float64, ray_x: Float64, ray_y: Float64, squares: Float64,
    far: Float32, xs: Float32, ys: Float32,
) -> None:  # fmt: skip
    for k in range(count):
        far[k] = single(distances[k]) * math.sqrt(single(squares[k]))
        xs[k] = single(x + distances[k] * ray_x[k])
        ys[k] = single(y + distances[k] * ray_y[k])
