"""The sky: a gradient, the sun's glow and clouds."""

from __future__ import annotations

import math

import numpy as np

from scenarionet_data.arrays.compiled import device_function
from scenarionet_data.arrays.dtypes import Float32, Float64, Int32, UInt8
from scenarionet_sim.kernels.cameras.layout import (
    BAND,
    BLUE,
    CLOUD,
    CX,
    CY,
    DOWN,
    FORWARD,
    FX,
    FY,
    GREEN,
    HORIZON,
    KIND,
    NOTHING,
    PINHOLE,
    RED,
    RIGHT,
    SHIFT,
    SKY_STEP,
    SKYLIGHT,
    SUN,
    SUNLIGHT,
    ZENITH,
)
from scenarionet_sim.kernels.cameras.singles import single
from scenarionet_sim.kernels.minmax import larger, smaller

_NOTHING = np.int32(NOTHING)

GRAIN_SIZE = 512
"""Side of the tables of noise [texels]; a power of two."""


@device_function(forceinline=True, divides_by_zero=True)
def smooth_noise(grain: UInt8, x: float, y: float) -> float:
    """Return coarse noise in [0, 1] at a place [texels], interpolated."""
    column, row = math.floor(x), math.floor(y)
    u, v = x - column, y - row
    i, j = int(column) & (GRAIN_SIZE - 1), int(row) & (GRAIN_SIZE - 1)
    k, m = (i + 1) & (GRAIN_SIZE - 1), (j + 1) & (GRAIN_SIZE - 1)
    above = grain[1, j * GRAIN_SIZE + i] * (1.0 - u) + grain[1, j * GRAIN_SIZE + k] * u
    below = grain[1, m * GRAIN_SIZE + i] * (1.0 - u) + grain[1, m * GRAIN_SIZE + k] * u
    return float(above * (1.0 - v) + below * v) * (1.0 / 255.0)


@device_function(forceinline=True, divides_by_zero=True)
def sky_gradient(light: Float64, z: float) -> tuple[float, float, float]:
    """Return the linear RGB of the clear sky in directions that rise by ``z`` (of a unit vector)."""
    share = math.sqrt(larger(z, 0.0))
    share = share * (1.6 - 0.6 * share)
    return (
        light[HORIZON] + (light[ZENITH] - light[HORIZON]) * share,
        light[HORIZON + 1] + (light[ZENITH + 1] - light[HORIZON + 1]) * share,
        light[HORIZON + 2] + (light[ZENITH + 2] - light[HORIZON + 2]) * share,
    )


@device_function(forceinline=True, divides_by_zero=True)
def sky_color(light: Float64, grain: UInt8, x: float, y: float, z: float) -> tuple[float, float, float]:
    """Return the linear RGB of the sky with sun and clouds in a direction (unit vector)."""
    red, green, blue = sky_gradient(light, z)
    toward = larger(x * light[SUN] + y * light[SUN + 1] + z * light[SUN + 2], 0.0)
    glow = toward * toward
    glow *= glow
    wide = 0.10 * glow
    glow *= glow
    glow *= glow
    glow *= glow
    shine = wide + 0.25 * glow * glow + (3.0 if toward > 0.99985 else 0.0)
    red, green, blue = (
        red + shine * light[SUNLIGHT],
        green + shine * light[SUNLIGHT + 1],
        blue + shine * light[SUNLIGHT + 2],
    )
    if z > 0.02 and light[CLOUD] > 0.0:
        scale = 26.0 / (z + 0.12)
        u, v = x * scale + light[SHIFT], y * scale + 0.7 * light[SHIFT]
        thick = 0.62 * smooth_noise(grain, u, v) + 0.38 * smooth_noise(grain, 2.7 * u + 90.0, 2.7 * v + 31.0)
        cover = smaller(larger((thick - 1.0 + light[CLOUD]) * 3.2, 0.0), 1.0) * smaller((z - 0.02) * 7.0, 1.0)
        bright = 0.75 + 0.5 * (1.0 - thick)
        red += cover * (bright * (0.8 * light[SKYLIGHT] + 0.22 * light[SUNLIGHT]) - red)
        green += cover * (bright * (0.8 * light[SKYLIGHT + 1] + 0.22 * light[SUNLIGHT + 1]) - green)
        blue += cover * (bright * (0.8 * light[SKYLIGHT + 2] + 0.22 * light[SUNLIGHT + 2]) - blue)
    return red, green, blue


@device_function(divides_by_zero=True, in_lanes=True)
def color_sky(
    row: int, start: int, begin: int, stop: int, size: tuple[int, int], pose: Float64, lens: Float64, rays: Float64,
    light: Float64, grain: UInt8, seen: Int32, nodes: Float32, shades: Float32,
) -> None:  # fmt: skip
    """Write the light of the sky in a tile's pixels that are in a row from column ``start`` on, between nodes."""
    top = row // BAND * BAND
    share = single((row - top) * (1.0 / BAND))
    first = begin
    while first < stop:
        column = start + first - begin
        node = column // SKY_STEP
        end = smaller(first + (node + 1) * SKY_STEP - column, stop)
        if _is_sky_seen(first, end, seen):
            for side in range(2):
                for place in (node, node + 1):
                    if nodes[side, place, 3] == 0.0:
                        nodes[side, place, 3] = 1.0
                        light_node(
                            smaller(top + side * BAND, size[0] - 1), smaller(place * SKY_STEP, size[1] - 1), pose,
                            lens, rays, light, grain, nodes[side, place],
                        )  # fmt: skip
            _blend_nodes(
                first, end, share, column - node * SKY_STEP - first, nodes[0, node], nodes[0, node + 1], nodes[1, node],
                nodes[1, node + 1], seen, shades[RED], shades[GREEN], shades[BLUE],
            )  # fmt: skip
        first = end


@device_function(forceinline=True, divides_by_zero=True, in_lanes=True)
def _is_sky_seen(first: int, end: int, seen: Int32) -> bool:
    found = np.int32(0)
    for k in range(first, end):
        found |= np.int32(1) if seen[k] == _NOTHING else np.int32(0)
    return bool(found > 0)


@device_function(divides_by_zero=True, in_lanes=True)
def _blend_nodes(
    first: int, end: int, share: float, shift: int, above: Float32, above_right: Float32, below: Float32,
    below_right: Float32, seen: Int32, red: Float32, green: Float32, blue: Float32,
) -> None:  # fmt: skip
    """Write the light between four nodes where the sky is seen; pixel k is ``k + shift`` right of the left ones."""
    r, g = above[0] + share * (below[0] - above[0]), above[1] + share * (below[1] - above[1])
    b = above[2] + share * (below[2] - above[2])
    step_r = (above_right[0] + share * (below_right[0] - above_right[0]) - r) * (1.0 / 8.0)
    step_g = (above_right[1] + share * (below_right[1] - above_right[1]) - g) * (1.0 / 8.0)
    step_b = (above_right[2] + share * (below_right[2] - above_right[2]) - b) * (1.0 / 8.0)
    for k in range(first, end):
        at, is_sky = single(k + shift), seen[k] == _NOTHING
        red[k] = r + step_r * at if is_sky else red[k]
        green[k] = g + step_g * at if is_sky else green[k]
        blue[k] = b + step_b * at if is_sky else blue[k]


@device_function(forceinline=True, in_lanes=True)
def carry_sky(is_below: bool, nodes: Float32) -> None:
    """Forget the light at the nodes of the band before, except for those at the top of a band right below it."""
    for node in range(nodes.shape[1]):
        for channel in range(4):
            nodes[0, node, channel] = nodes[1, node, channel] if is_below else 0.0
        nodes[1, node, 3] = 0.0


@device_function(divides_by_zero=True)
def light_node(
    row: int, column: int, pose: Float64, lens: Float64, rays: Float64, light: Float64, grain: UInt8, node: Float32
) -> None:
    """Write the light of the sky along the ray of a pixel."""
    x, y, z = (column + 0.5 - lens[CX]) / lens[FX], (row + 0.5 - lens[CY]) / lens[FY], 1.0
    if lens[KIND] != PINHOLE:
        x, y, z = rays[row, column, 0], rays[row, column, 1], rays[row, column, 2]
    scale = 1.0 / math.sqrt(x * x + y * y + z * z)
    east = (x * pose[RIGHT] + y * pose[DOWN] + z * pose[FORWARD]) * scale
    north = (x * pose[RIGHT + 1] + y * pose[DOWN + 1] + z * pose[FORWARD + 1]) * scale
    up = (x * pose[RIGHT + 2] + y * pose[DOWN + 2] + z * pose[FORWARD + 2]) * scale
    node[0], node[1], node[2] = sky_color(light, grain, east, north, up)
