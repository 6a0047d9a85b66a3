"""Shading of a tile: shadows on the ground, the colours of triangles, haze and the tone of the picture."""

from __future__ import annotations

import math

import numpy as np

from scenarionet_data.arrays.dtypes import Float32, Float64, Int32, UInt8
from scenarionet_data.compiled.decorators import device_function
from scenarionet_sim.arrays.minmax import larger, smaller
from scenarionet_sim.cameras.draw import codes
from scenarionet_sim.cameras.draw import columns as at
from scenarionet_sim.cameras.draw.facades import draw_wall
from scenarionet_sim.cameras.draw.single_precision import bits_of, number_of, single, single_of, singles
from scenarionet_sim.cameras.draw.structures import FrameView, Triangles, Triple

OCTAVES = -12.0, math.log2(3.0)
"""Binary logarithms of the linear light that is shown as black and as white."""

_DARKEST, _BRIGHTEST = 2.0 ** OCTAVES[0], 2.0 ** OCTAVES[1]
_SCALE = 2.0 / (OCTAVES[1] - OCTAVES[0])
_MANTISSA, _ONE_BITS = np.int32((1 << 23) - 1), np.int32(127 << 23)
_PER_BIT, _SHIFT, _BEND, _BEND_STEP = (
    _SCALE * factor for factor in (2.0**-23, 127 + sum(OCTAVES) / 2, 0.42086, -0.15639)
)
"""The bits of a float32 are its binary logarithm but for the bend of that between powers of two, here to 0.001."""

Light = tuple[float, float, float]
"""Linear RGB."""

PART = 32
"""Pixels of a row that are tested together for being beside a shadow."""

LONG = 8
"""Pixels of a row from which on it is worth finding all that see the same triangle."""

ROUND = 0.4
"""Largest radius of the corners of shadows [m]."""

SOFT = 0.3
"""Width of the soft edge of a shadow outside of its outline [m]."""


@device_function(divides_by_zero=True, in_lanes=True)
def cast_shadows(
    row: int, start: int, strength: float, frame: Float64, shadows: Float64, seen: Int32, spots: Triple
) -> None:
    """Lower the share of sunlight that arrives at the ground, under and behind objects, in pixels of a row.

    With a strength of 0, add the light of lamps instead.

    Only points of the ground are on a line: what is seen before it, and the sky, does not bound those between.
    """
    xs, ys, shade = spots
    for n in range(len(shadows)):
        if not shadows[n, 9] <= row < shadows[n, 11] or (strength == 0.0) != (shadows[n, 12] < 0.0):
            continue
        first, end = int(larger(shadows[n, 8] - start, 0.0)), int(smaller(shadows[n, 10] - start, len(xs) * 1.0))
        for begin in range(first, end, PART):
            left, right = begin, smaller(begin + PART, end)
            while left < right and seen[left] != codes.ON_GROUND:
                left += 1
            while left < right and seen[right - 1] != codes.ON_GROUND:
                right -= 1
            if left == right or _is_beside(shadows[n], frame, xs[left], ys[left], xs[right - 1], ys[right - 1]):
                continue
            x, y = single(shadows[n, 0] - frame[0]), single(shadows[n, 1] - frame[1])
            if strength == 0.0:
                _shine(x, y, shadows[n], xs[left:right], ys[left:right], shade[left:right])
            else:
                _cast(single(strength), x, y, shadows[n], xs[left:right], ys[left:right], shade[left:right])


@device_function(divides_by_zero=True, in_lanes=True)
def _shine(x0: float, y0: float, lamp: Float64, xs: Float32, ys: Float32, shade: Float32) -> None:
    """Add the light of a lamp, an ellipse on the ground."""
    cos, sin, bright = single(lamp[2]), single(lamp[3]), single(lamp[12])
    per_length, per_width = single(1.0 / lamp[4]), single(1.0 / lamp[5])
    for k in range(len(xs)):
        dx, dy = xs[k] - x0, ys[k] - y0
        x, y = (cos * dx + sin * dy) * per_length, (cos * dy - sin * dx) * per_width
        part = larger(1.0 - x * x - y * y, 0.0)
        shade[k] -= bright * part * part


@device_function(divides_by_zero=True, in_lanes=True)
def _is_beside(shadow: Float64, frame: Float64, x0: float, y0: float, x1: float, y1: float) -> bool:
    """Whether a shadow and the points between two are on different sides of an edge of the box around the shadow."""
    cos, sin, x, y = shadow[2], shadow[3], shadow[0] - frame[0], shadow[1] - frame[1]
    first, last = cos * (x0 - x) + sin * (y0 - y), cos * (x1 - x) + sin * (y1 - y)
    pad, sweep = shadow[4] + SOFT, shadow[6]
    if larger(first, last) < smaller(sweep, 0.0) - pad or smaller(first, last) > larger(sweep, 0.0) + pad:
        return True
    first, last = cos * (y0 - y) - sin * (x0 - x), cos * (y1 - y) - sin * (x1 - x)
    pad, sweep = shadow[5] + SOFT, shadow[7]
    return bool(larger(first, last) < smaller(sweep, 0.0) - pad or smaller(first, last) > larger(sweep, 0.0) + pad)


@device_function(divides_by_zero=True, in_lanes=True)
def _cast(strength: float, x0: float, y0: float, shadow: Float64, xs: Float32, ys: Float32, shade: Float32) -> None:
    """Cast the shadow of a rounded box, swept along the light, with an edge that softens with the distance from it."""
    cos, sin = single(shadow[2]), single(shadow[3])
    sweep_x, sweep_y, touch = single(shadow[6]), single(shadow[7]), single(shadow[12])
    corner = single(smaller(smaller(shadow[4], shadow[5]), ROUND))
    half_length, half_width = single(shadow[4]) - corner, single(shadow[5]) - corner
    inverse = 1.0 / (sweep_x * sweep_x + sweep_y * sweep_y + 1e-9)
    for k in range(len(xs)):
        dx, dy = xs[k] - x0, ys[k] - y0
        x, y = cos * dx + sin * dy, cos * dy - sin * dx
        along = smaller(larger((x * sweep_x + y * sweep_y) * inverse, 0.0), 1.0)
        out = _outside(abs(x - along * sweep_x) - half_length, abs(y - along * sweep_y) - half_width) - corner
        close = _outside(abs(x) - half_length, abs(y) - half_width) - corner
        cast = smaller(larger(0.5 - out / (0.12 + 0.28 * along), 0.0), 1.0) * (1.0 - 0.35 * along)
        contact = smaller(larger(0.55 - close * 2.0, 0.0), 1.0)
        contact *= touch * contact * (3.0 - 2.0 * contact)
        shade[k] *= 1.0 - strength * larger(cast, contact)


@device_function(forceinline=True, divides_by_zero=True, in_lanes=True)
def _outside(x: float, y: float) -> float:
    """Return about the distance of a point from a box, by how far it is outside of its sides; negative inside."""
    return float(larger(larger(x, y), 0.7071 * (x + y)))


@device_function(divides_by_zero=True, in_lanes=True)
def color_triangles(
    row: int, shift: int, pixels: tuple[int, int], view: FrameView, triangles: Triangles, seen: Int32, shades: Float32
) -> None:
    """Write the light of triangles in pixels of a row, run by run of those that see the same one.

    Args:
        row, shift: Pixel k of the tile is in this row and in column ``k + shift``.
        pixels: First one and end of those of the tile.
        view: The camera.
        triangles, seen, shades: See ``FrameMemory``.
    """
    rgb, (first, end) = (shades[at.RED], shades[at.GREEN], shades[at.BLUE]), pixels
    begin, line = first, single(row)
    while begin < end:
        triangle = seen[begin]
        if triangle < 0:
            begin += 1
            continue
        color, column, stop = triangles.colors[triangle], single(begin + shift), begin + 1
        is_wall = triangles.labels[triangle, at.MATERIAL] == codes.FACADE
        if is_wall or (begin + LONG <= end and seen[begin + LONG - 1] == triangle):
            while stop < end and seen[stop] == triangle:
                stop += 1
        red, green = color[0] + color[1] * column + color[2] * line, color[3] + color[4] * column + color[5] * line
        light = red, green, color[6] + color[7] * column + color[8] * line
        if stop == begin + 1 and not is_wall:
            begin += _grade_few(begin, end, triangle, seen, light, color, rgb)
            continue
        if is_wall:
            draw_wall(begin, stop, color, single(1.0 / view.lens[at.FX]), view.light, shades)
        else:
            _grade(begin, stop, light, color, rgb)
        begin = stop


@device_function(divides_by_zero=True, in_lanes=True)
def _grade(first: int, end: int, light: Light, color: Float32, rgb: Triple) -> None:
    """Write light that is linear along a row."""
    red, green, blue = light
    red_step, green_step, blue_step = color[1], color[4], color[7]
    reds, greens, blues = rgb
    for lane in range(end - first):
        k, place = first + lane, single_of(lane)
        reds[k], greens[k], blues[k] = red + red_step * place, green + green_step * place, blue + blue_step * place


@device_function(forceinline=True, divides_by_zero=True, in_lanes=True)
def _grade_few(first: int, end: int, triangle: int, seen: Int32, light: Light, color: Float32, rgb: Triple) -> int:
    """Write light that is linear along a row in at most ``LONG`` pixels that see a triangle; return how many."""
    red, green, blue = light
    red_step, green_step, blue_step = color[1], color[4], color[7]
    reds, greens, blues = rgb
    count = LONG
    for lane in range(smaller(end - first, LONG)):
        k, place = first + lane, single_of(lane)
        is_same = seen[k] == triangle
        reds[k] = red + red_step * place if is_same else reds[k]
        greens[k] = green + green_step * place if is_same else greens[k]
        blues[k] = blue + blue_step * place if is_same else blues[k]
        count = smaller(count, LONG if is_same else lane)
    return smaller(count, end - first)


@device_function(forceinline=True, divides_by_zero=True)
def expose(first: int, view: FrameView, tone: Float32, seen: Int32, shades: Float32, picture: UInt8) -> None:
    """Add haze and write the colours of a tile into a part of a picture (3 * count,), pixel by pixel.

    Args:
        first: Number of the tile's first pixel in the picture.
        view, tone: The camera and its tone curve.
        seen, shades: Memory of the tile.
        picture: Output.
    """
    count, gains, light, width = len(seen), shades[at.GAIN], view.light, view.width
    begin, row, column = 0, first // width, first % width
    while begin < count:
        end, below = smaller(begin + width - column, count), (row + 0.5) / view.height - 0.5
        loss = 2.0 * light[at.VIGNETTE] * light[at.EXPOSURE]
        middle = light[at.EXPOSURE] - loss * below * below
        _dim_sides(begin, end, (column - begin + 0.5) / width - 0.5, 1.0 / width, (middle, loss), gains)
        begin, row, column = end, row + 1, 0
    rgb = shades[at.RED], shades[at.GREEN], shades[at.BLUE]
    _develop(light, tone, seen, shades[at.FAR], gains, rgb, picture)


@device_function(divides_by_zero=True, in_lanes=True)
def _dim_sides(first: int, end: int, left: float, step: float, gain: tuple[float, float], gains: Float32) -> None:
    """Write the gains of pixels of a row: that of its middle, less what is lost with the square of the way from it."""
    start, width, middle, loss = single(left), single(step), single(gain[0]), single(gain[1])
    for k in range(first, end):
        beside = start + width * single_of(k)
        gains[k] = middle - loss * beside * beside


@device_function(divides_by_zero=True, in_lanes=True)
def _develop(
    light: Float64, tone: Float32, seen: Int32, far: Float32, gains: Float32, rgb: Triple, picture: UInt8
) -> None:
    """Blend what is far away with the light of the horizon; write the levels of linear light."""
    (red, green, blue), count = rgb, len(seen)
    haze = single(light[at.HAZE])
    r, g, b = singles(light, at.HORIZON)
    for k in range(count):
        mist = 0.0 if seen[k] == codes.NOTHING else far[k] * haze
        clear, gain = 1.0 / (1.0 + mist * (1.0 + 0.5 * mist)), gains[k]
        picture[3 * k] = level_of((r + clear * (red[k] - r)) * gain, tone)
        picture[3 * k + 1] = level_of((g + clear * (green[k] - g)) * gain, tone)
        picture[3 * k + 2] = level_of((b + clear * (blue[k] - b)) * gain, tone)


@device_function(forceinline=True, divides_by_zero=True, in_lanes=True)
def level_of(light: float, tone: Float32) -> int:
    """Return the level of linear light, see ``Look.tone``."""
    bits = bits_of(smaller(larger(light, _DARKEST), _BRIGHTEST))
    rest = number_of(int((bits & _MANTISSA) | _ONE_BITS)) - 1.0
    x = single(bits) * _PER_BIT - _SHIFT + (rest - rest * rest) * (_BEND + _BEND_STEP * rest)
    low = tone[0] + x * (tone[1] + x * (tone[2] + x * tone[3]))
    return np.int32(low + x * x * x * x * (tone[4] + x * (tone[5] + x * (tone[6] + x * (tone[7] + x * tone[8])))))  # type: ignore[return-value]
