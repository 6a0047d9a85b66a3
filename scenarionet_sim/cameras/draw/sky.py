"""The sky: a gradient, the sun's glow and clouds."""

from __future__ import annotations

import math

import numpy as np

from scenarionet_data.arrays.dtypes import Float32, Float64, Int32, UInt8
from scenarionet_data.compiled.decorators import device_function
from scenarionet_sim.arrays.minmax import larger, smaller
from scenarionet_sim.cameras.draw import codes
from scenarionet_sim.cameras.draw import columns as at
from scenarionet_sim.cameras.draw.single_precision import rounded_down, single, singles
from scenarionet_sim.cameras.draw.structures import BAND, SKY_STEP, FrameView, Tile, Triple

_NOTHING = np.int32(codes.NOTHING)

GRAIN_SIZE = 512
"""Side of the tables of noise [texels]; a power of two."""

IS_LIT = 3
"""Row of the sky's light that says in its first column whether it is there."""

_LANES = 8

_BITS, _LAST, _ONE = np.int32(GRAIN_SIZE.bit_length() - 1), np.int32(GRAIN_SIZE - 1), np.int32(1)


@device_function(forceinline=True, divides_by_zero=True, in_lanes=True)
def smooth_noise(grain: UInt8, x: float, y: float) -> float:
    """Return coarse noise in [0, 1] at a place [texels], interpolated."""
    column, row = rounded_down(x), rounded_down(y)
    u, v = single(x - column), single(y - row)
    i, j = np.int32(column) & _LAST, np.int32(row) & _LAST
    k, above, below = (i + _ONE) & _LAST, j << _BITS, ((j + _ONE) & _LAST) << _BITS
    first = grain[np.uint32(above | i)] * (1.0 - u) + grain[np.uint32(above | k)] * u
    last = grain[np.uint32(below | i)] * (1.0 - u) + grain[np.uint32(below | k)] * u
    return float(first * (1.0 - v) + last * v) * (1.0 / 255.0)


@device_function(forceinline=True, divides_by_zero=True)
def sky_gradient(light: Float64, z: float) -> tuple[float, float, float]:
    """Return the linear RGB of the clear sky in directions that rise by ``z`` (of a unit vector)."""
    share = math.sqrt(larger(z, 0.0))
    share = share * (1.6 - 0.6 * share)
    return (
        light[at.HORIZON] + (light[at.ZENITH] - light[at.HORIZON]) * share,
        light[at.HORIZON + 1] + (light[at.ZENITH + 1] - light[at.HORIZON + 1]) * share,
        light[at.HORIZON + 2] + (light[at.ZENITH + 2] - light[at.HORIZON + 2]) * share,
    )


@device_function(divides_by_zero=True, in_lanes=True)
def color_sky(row: int, start: int, pixels: tuple[int, int], view: FrameView, grain: UInt8, tile: Tile) -> None:
    """Write the light of the sky in a tile's pixels that are in a row from column ``start`` on.

    It is interpolated between the light in the rows above and below of the band, ``sky``, and there between nodes.
    """
    (begin, stop), seen, shades, sky = pixels, tile.seen, tile.shades, tile.sky
    if not _is_sky_seen(begin, stop, seen):
        return
    top = row // BAND * BAND
    for side in range(2):
        if sky[side, IS_LIT, 0] == 0.0:
            node_row = smaller(top + side * BAND, view.height - 1)
            light_nodes(node_row, 0, num_nodes(view.width), view, grain, tile.nodes)
            _stretch(tile.nodes, view.width, sky[side])
            sky[side, IS_LIT, 0] = 1.0
    rgb, share = (shades[at.RED], shades[at.GREEN], shades[at.BLUE]), single((row - top) * (1.0 / BAND))
    _blend_rows(pixels, start - begin, share, sky[0], sky[1], seen, rgb)


@device_function(forceinline=True, divides_by_zero=True, in_lanes=True)
def _is_sky_seen(first: int, end: int, seen: Int32) -> bool:
    found = np.int32(0)
    for k in range(first, end):
        found |= np.int32(1) if seen[k] == _NOTHING else np.int32(0)
    return bool(found > 0)


@device_function(divides_by_zero=True, in_lanes=True)
def _stretch(nodes: Float32, width: int, sky: Float32) -> None:
    """Write the light of a row of pixels between its nodes."""
    for channel in range(3):
        for node in range((width + SKY_STEP - 1) // SKY_STEP):
            for lane in range(SKY_STEP):
                sky[channel, node * SKY_STEP + lane] = between_nodes(nodes, channel, node, lane)


@device_function(forceinline=True, divides_by_zero=True, in_lanes=True)
def between_nodes(nodes: Float32, channel: int, node: int, lane: int) -> float:
    """Return the light of a pixel a number of columns right of a node."""
    first = nodes[channel, node]
    return float(first + (nodes[channel, node + 1] - first) * (1.0 / SKY_STEP) * single(lane))


@device_function(divides_by_zero=True, in_lanes=True)
def _blend_rows(
    pixels: tuple[int, int], shift: int, share: float, above: Float32, below: Float32, seen: Int32, rgb: Triple
) -> None:
    """Write the light between two rows of pixels where the sky is seen, in pixels k in column ``k + shift``."""
    red, green, blue = rgb
    first, end = pixels
    for k in range(first, end):
        is_sky, column = seen[k] == _NOTHING, k + shift
        r, g, b = above[0, column], above[1, column], above[2, column]
        red[k] = r + share * (below[0, column] - r) if is_sky else red[k]
        green[k] = g + share * (below[1, column] - g) if is_sky else green[k]
        blue[k] = b + share * (below[2, column] - b) if is_sky else blue[k]


@device_function(forceinline=True)
def num_nodes(width: int) -> int:
    """Return the number of nodes along a picture of some width; a multiple of those that are lit at once."""
    return (width // SKY_STEP + 2 + _LANES - 1) // _LANES * _LANES


@device_function(forceinline=True, in_lanes=True)
def carry_sky(is_below: bool, width: int, sky: Float32) -> None:
    """Forget the light of the band before, except for that at the top of a band right below it."""
    sky[0, IS_LIT, 0] = sky[1, IS_LIT, 0] if is_below else single(0.0)
    if sky[0, IS_LIT, 0] > 0.0:
        for channel in range(3):
            for column in range(width):
                sky[0, channel, column] = sky[1, channel, column]
    sky[1, IS_LIT, 0] = 0.0


@device_function(divides_by_zero=True)
def light_nodes(row: int, first: int, end: int, view: FrameView, grain: UInt8, nodes: Float32) -> None:
    """Write the light of the sky along the rays of nodes of a row of pixels.

    Args:
        row: Of the picture.
        first, end: Nodes.
        view, grain: The camera and the noise of clouds.
        nodes: (3, N) output.
    """
    lens, rays, width = view.lens, view.rays, view.width
    y, step = (row + 0.5 - lens[at.CY]) / lens[at.FY], 1.0 / lens[at.FX]
    for k in range(first, end):
        column = smaller(k * SKY_STEP, width - 1)
        if lens[at.KIND] == codes.PINHOLE:
            nodes[0, k], nodes[1, k], nodes[2, k] = (column + 0.5 - lens[at.CX]) * step, y, 1.0
        else:
            nodes[0, k], nodes[1, k], nodes[2, k] = rays[row, column, 0], rays[row, column, 1], rays[row, column, 2]
    _light_along(first, end, view.pose, view.light, grain[1], nodes[0], nodes[1], nodes[2])


@device_function(divides_by_zero=True, in_lanes=True)
def _light_along(
    first: int, end: int, pose: Float64, light: Float64, grain: UInt8, red: Float32, green: Float32, blue: Float32
) -> None:
    """Replace directions right, below and ahead of the camera by the linear RGB of the sky with sun and clouds."""
    sun_x, sun_y, sun_z = singles(light, at.SUN)
    sun_r, sun_g, sun_b = singles(light, at.SUNLIGHT)
    if light[at.NIGHT] > 0.0:
        sun_r = sun_g = sun_b = single(0.0)
    sky_r, sky_g, sky_b = singles(light, at.SKYLIGHT)
    low_r, low_g, low_b = singles(light, at.HORIZON)
    high_r, high_g, high_b = singles(light, at.ZENITH)
    rx, ry, rz = singles(pose, at.RIGHT)
    dx, dy, dz = singles(pose, at.DOWN)
    fx, fy, fz = singles(pose, at.FORWARD)
    clouds, shift = single(light[at.CLOUD]), single(light[at.SHIFT])
    for k in range(first, end):
        right, down, ahead = red[k], green[k], blue[k]
        per = 1.0 / math.sqrt(right * right + down * down + ahead * ahead)
        x = (right * rx + down * dx + ahead * fx) * per
        y = (right * ry + down * dy + ahead * fy) * per
        z = (right * rz + down * dz + ahead * fz) * per
        root = math.sqrt(larger(z, 0.0))
        share = root * (1.6 - 0.6 * root)  # as ``sky_gradient``
        toward = larger(x * sun_x + y * sun_y + z * sun_z, 0.0)
        glow = toward * toward
        glow *= glow
        wide = 0.10 * glow
        glow *= glow
        glow *= glow
        glow *= glow
        shine = wide + 0.25 * glow * glow + (3.0 if toward > 0.99985 else 0.0)
        scale = 26.0 / (larger(z, 0.0) + 0.12)
        u, v = x * scale + shift, y * scale + 0.7 * shift
        thick = 0.62 * smooth_noise(grain, u, v) + 0.38 * smooth_noise(grain, 2.7 * u + 90.0, 2.7 * v + 31.0)
        cover = smaller(larger((thick - 1.0 + clouds) * 3.2, 0.0), 1.0) * smaller(larger((z - 0.02) * 7.0, 0.0), 1.0)
        cover = cover if clouds > 0.0 else 0.0
        sky, sun = (0.75 + 0.5 * (1.0 - thick)) * 0.8, (0.75 + 0.5 * (1.0 - thick)) * 0.22
        r, g = low_r + (high_r - low_r) * share + shine * sun_r, low_g + (high_g - low_g) * share + shine * sun_g
        b = low_b + (high_b - low_b) * share + shine * sun_b
        red[k] = r + cover * (sky * sky_r + sun * sun_r - r)
        green[k] = g + cover * (sky * sky_g + sun * sun_g - g)
        blue[k] = b + cover * (sky * sky_b + sun * sun_b - b)
