"""Parts of rows: the rays of their pixels, and whether a triangle, the ground or the sky is seen along them."""

from __future__ import annotations

import math

import numpy as np

from scenarionet_data.arrays.compiled import device_function
from scenarionet_data.arrays.dtypes import Float64, Int32
from scenarionet_sim.kernels.cameras.ground import meet_heights
from scenarionet_sim.kernels.cameras.layout import (
    CX,
    CY,
    DISTANCE,
    DOWN,
    EYE,
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
    SHADE,
    UNIT,
    Ground,
)
from scenarionet_sim.kernels.minmax import larger

# One output per loop, and no load behind a condition: the compiler then computes several pixels at once.


@device_function(divides_by_zero=True)
def aim_rays(row: int, start: int, count: int, pose: Float64, lens: Float64, rays: Float64, values: Float64) -> None:
    """Write the directions of the pixels of a tile's row, and their lengths."""
    rx, ry, rz = pose[RIGHT], pose[RIGHT + 1], pose[RIGHT + 2]
    if lens[KIND] != PINHOLE:
        for k in range(count):
            x, y, z = rays[row, start + k, 0], rays[row, start + k, 1], rays[row, start + k, 2]
            values[RAY_X, k] = x * rx + y * pose[DOWN] + z * pose[FORWARD]
            values[RAY_Y, k] = x * ry + y * pose[DOWN + 1] + z * pose[FORWARD + 1]
            values[RAY_Z, k] = x * rz + y * pose[DOWN + 2] + z * pose[FORWARD + 2]
            values[UNIT, k] = math.sqrt(x * x + y * y + z * z)
        return
    v, step = (row + 0.5 - lens[CY]) / lens[FY], 1.0 / lens[FX]
    first = (start + 0.5 - lens[CX]) * step
    bx, by = v * pose[DOWN] + pose[FORWARD], v * pose[DOWN + 1] + pose[FORWARD + 1]
    bz = v * pose[DOWN + 2] + pose[FORWARD + 2]
    rest = v * v + 1.0
    for k in range(count):
        values[RAY_X, k] = (first + step * k) * rx + bx
    for k in range(count):
        values[RAY_Y, k] = (first + step * k) * ry + by
    for k in range(count):
        values[RAY_Z, k] = (first + step * k) * rz + bz
    for k in range(count):
        u = first + step * k
        values[UNIT, k] = math.sqrt(u * u + rest)


@device_function(divides_by_zero=True)
def meet_ground(
    count: int, slot: int, pose: Float64, reach: float, ground: Ground, near: Float64, seen: Int32,
    values: Float64,
) -> None:  # fmt: skip
    """Write how far the pixels of a tile's row see, and what: the nearer of ground and triangle."""
    ex, ey, ez = pose[EYE], pose[EYE + 1], pose[EYE + 2]
    inverse = 1.0 / (ground.level[slot] - ez)
    if ground.height_frame[slot, 3] > 0.0:
        for k in range(count):
            values[SHADE, k] = 1.0 / meet_heights(
                ground, slot, ex, ey, ez, values[RAY_X, k], values[RAY_Y, k], values[RAY_Z, k], reach
            )
    else:
        for k in range(count):
            values[SHADE, k] = values[RAY_Z, k] * inverse
    for k in range(count):  # inverse distances to the ground in reach, else 0
        near_ground = values[SHADE, k]
        values[SHADE, k] = near_ground if values[UNIT, k] < reach * near_ground else 0.0
    for k in range(count):
        nearest = larger(near[k], values[SHADE, k])
        values[DISTANCE, k] = 1.0 / nearest if nearest > 0.0 else reach
    for k in range(count):
        ground_or_sky = ON_GROUND if values[SHADE, k] > 0.0 else NOTHING
        before = seen[k]
        is_triangle = (near[k] >= values[SHADE, k]) & (before >= 0)
        seen[k] = before if is_triangle else np.int32(ground_or_sky)
    for k in range(count):
        values[GROUND_X, k] = ex + values[DISTANCE, k] * values[RAY_X, k]
    for k in range(count):
        values[GROUND_Y, k] = ey + values[DISTANCE, k] * values[RAY_Y, k]
