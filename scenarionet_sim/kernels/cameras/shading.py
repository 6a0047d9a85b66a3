"""Shading of a row: shadows on the ground, the colours of triangles, haze and the tone of the picture."""

from __future__ import annotations

import math

import numpy as np

from scenarionet_data.arrays.compiled import device_function
from scenarionet_data.arrays.dtypes import Float32, Float64, Int32, UInt8
from scenarionet_sim.kernels.cameras.layout import (
    BLUE,
    CX,
    CY,
    DISTANCE,
    EXPOSURE,
    EYE,
    FACADE,
    FX,
    FY,
    GREEN,
    GROUND_X,
    GROUND_Y,
    HAZE,
    HORIZON,
    IS_FLAT,
    KIND,
    MATERIAL,
    NOTHING,
    PINHOLE,
    RAY_X,
    RAY_Z,
    RED,
    SHADE,
    UNIT,
    VIGNETTE,
)
from scenarionet_sim.kernels.minmax import larger, smaller


@device_function(divides_by_zero=True)
def cast_shadows(
    row: int, start: int, count: int, num_shadows: int, strength: float, values: Float64, shadows: Float64
) -> None:
    """Write the share of sunlight that arrives at the ground, under and behind objects less than 1."""
    for k in range(count):
        values[SHADE, k] = 1.0
    for n in range(num_shadows):
        if not shadows[n, 9] <= row < shadows[n, 11]:
            continue
        first, end = int(larger(shadows[n, 8] - start, 0.0)), int(smaller(shadows[n, 10] - start, count * 1.0))
        if first < end:
            _cast(
                strength, shadows[n], values[GROUND_X, first:end], values[GROUND_Y, first:end], values[SHADE, first:end]
            )


@device_function(divides_by_zero=True)
def _cast(strength: float, shadow: Float64, xs: Float64, ys: Float64, shares: Float64) -> None:
    """Cast the shadow of a box, swept along the light, with an edge that softens with the distance from the box."""
    x0, y0, cos, sin = shadow[0] + 0.0, shadow[1] + 0.0, shadow[2] + 0.0, shadow[3] + 0.0
    half_length, half_width, sweep_x, sweep_y = shadow[4] + 0.0, shadow[5] + 0.0, shadow[6] + 0.0, shadow[7] + 0.0
    inverse = 1.0 / (sweep_x * sweep_x + sweep_y * sweep_y + 1e-9)
    for k in range(len(xs)):
        dx, dy = xs[k] - x0, ys[k] - y0
        x, y = cos * dx + sin * dy, cos * dy - sin * dx
        along = smaller(larger((x * sweep_x + y * sweep_y) * inverse, 0.0), 1.0)
        out = larger(abs(x - along * sweep_x) - half_length, abs(y - along * sweep_y) - half_width)
        close = larger(abs(x) - half_length, abs(y) - half_width)
        cast = smaller(larger(0.5 - out / (0.05 + 0.30 * along), 0.0), 1.0) * (1.0 - 0.35 * along)
        contact = 0.9 * smaller(larger(0.55 - close * 2.0, 0.0), 1.0)
        shares[k] *= 1.0 - strength * larger(cast, contact)


@device_function(divides_by_zero=True)
def color_triangles(
    row: int, start: int, count: int, pose: Float64, lens: Float64, rays: Float64, edges: Float64, colors: Float32,
    labels: Int32, seen: Int32, values: Float64,
) -> None:  # fmt: skip
    """Write the light of triangles, one run of a triangle's pixels after another."""
    first = 0
    while first < count:
        triangle = seen[first]
        if triangle < 0:
            first += 1
            continue
        end = first + 1
        while end < count and seen[end] == triangle:
            end += 1
        if labels[triangle, IS_FLAT]:
            red, green, blue = colors[triangle, 0] * 1.0, colors[triangle, 1] * 1.0, colors[triangle, 2] * 1.0
            for k in range(first, end):
                values[RED, k], values[GREEN, k], values[BLUE, k] = red, green, blue
        else:
            _interpolate(
                row, start + first, lens, rays, edges[triangle], colors[triangle], values[RED, first:end],
                values[GREEN, first:end], values[BLUE, first:end],
            )  # fmt: skip
        if labels[triangle, MATERIAL] == FACADE:
            _open_windows(first, end, pose, 1.0 / lens[FX], colors[triangle], values)
        first = end


@device_function(divides_by_zero=True)
def _interpolate(
    row: int, first: int, lens: Float64, rays: Float64, edges: Float64, colors: Float32, red: Float64, green: Float64,
    blue: Float64,
) -> None:  # fmt: skip
    """Write the light of a run of pixels of a triangle from column ``first`` on, between that at its corners."""
    y, z, step = (row + 0.5 - lens[CY]) / lens[FY], 1.0, 1.0 / lens[FX]
    is_pinhole, left = lens[KIND] == PINHOLE, (first + 0.5 - lens[CX]) * step
    e0, e1, e2, e3, e4, e5 = (
        edges[0] + 0.0,
        edges[1] + 0.0,
        edges[2] + 0.0,
        edges[3] + 0.0,
        edges[4] + 0.0,
        edges[5] + 0.0,
    )
    e6, e7, e8 = edges[6] + 0.0, edges[7] + 0.0, edges[8] + 0.0
    for k in range(len(red)):
        x = left + step * k
        if not is_pinhole:
            x, y, z = rays[row, first + k, 0], rays[row, first + k, 1], rays[row, first + k, 2]
        a = larger(e0 * x + e1 * y + e2 * z, 0.0)
        b = larger(e3 * x + e4 * y + e5 * z, 0.0)
        c = larger(e6 * x + e7 * y + e8 * z, 0.0)
        unit = 1.0 / (a + b + c + 1e-300)
        red[k], green[k], blue[k] = a * unit, b * unit, c * unit
    r0, r1, r2 = colors[0] * 1.0, colors[3] * 1.0, colors[6] * 1.0
    g0, g1, g2 = colors[1] * 1.0, colors[4] * 1.0, colors[7] * 1.0
    b0, b1, b2 = colors[2] * 1.0, colors[5] * 1.0, colors[8] * 1.0
    for k in range(len(red)):
        a, b, c = red[k], green[k], blue[k]
        red[k], green[k] = a * r0 + b * r1 + c * r2, a * g0 + b * g1 + c * g2
        blue[k] = a * b0 + b * b1 + c * b2


@device_function(divides_by_zero=True)
def _open_windows(first: int, end: int, pose: Float64, angle: float, colors: Float32, values: Float64) -> None:
    """Darken the windows of the storeys of a wall."""
    nx, ny = colors[9] * 1.0, colors[10] * 1.0
    level = pose[EYE + 2] + 0.0
    for k in range(first, end):
        far = values[DISTANCE, k]
        u = (nx * values[GROUND_Y, k] - ny * values[GROUND_X, k]) * (1.0 / 3.2)
        v = (level + far * values[RAY_Z, k]) * (1.0 / 3.3)
        u, v = u - math.floor(u), v - math.floor(v)
        is_window = u > 0.22 and u < 0.78 and v > 0.28 and v < 0.80
        share = smaller(larger(1.2 - far * angle * 0.8, 0.0), 1.0)
        bright = 1.0 - 0.72 * ((1.0 if is_window else 0.0) * share + 0.29 * (1.0 - share))
        values[RED, k] *= bright
        values[GREEN, k] *= bright
        values[BLUE, k] *= 0.1 + 0.9 * bright


@device_function(divides_by_zero=True)
def expose(
    row: int, start: int, count: int, size: tuple[int, int], light: Float64, tone: UInt8, seen: Int32, levels: Int32,
    values: Float64, picture: UInt8,
) -> None:  # fmt: skip
    """Add haze and write the colours of a tile's row into a part of a picture (count, 3).

    Highlights are compressed: 1.25 x / (x + 0.75).
    """
    haze, gain, vignette = light[HAZE], light[EXPOSURE], 2.0 * light[VIGNETTE]
    for k in range(count):
        mist = values[DISTANCE, k] * values[UNIT, k] * haze
        clear = 1.0 / (1.0 + mist * (1.0 + 0.5 * mist))
        values[SHADE, k] = 1.0 if seen[k] == NOTHING else clear
    for channel in range(3):
        horizon = light[HORIZON + channel] + 0.0
        for k in range(count):
            values[RED + channel, k] = (horizon + values[SHADE, k] * (values[RED + channel, k] - horizon)) * gain
        if vignette > 0.0:
            below = (row + 0.5) / size[0] - 0.5
            for k in range(count):
                beside = (start + k + 0.5) / size[1] - 0.5
                values[RED + channel, k] *= 1.0 - vignette * (below * below + beside * beside)
    for k in range(count):  # one division for three channels
        red, green, blue = values[RED, k] + 0.75, values[GREEN, k] + 0.75, values[BLUE, k] + 0.75
        values[RAY_X, k] = 5119.0 / (red * green * blue)
    for channel in range(3):
        second, third = RED + (channel + 1) % 3, RED + (channel + 2) % 3
        for k in range(count):
            level = values[RED + channel, k] * values[RAY_X, k] * (values[second, k] + 0.75) * (values[third, k] + 0.75)
            levels[k] = np.int32(level if level < 4095.0 else 4095.0)
        for k in range(count):
            picture[k, channel] = tone[levels[k]]
