"""Walls of buildings: storeys of whole windows, a door in the middle, shops with signs, and lit windows in the dark.

The light of a wall is the same everywhere: the columns of ``Triangles.colors`` for its steps have the layout instead.
"""

from __future__ import annotations

import math

import numpy as np

from scenarionet_data.arrays.dtypes import Float32, Float64
from scenarionet_data.compiled.decorators import device_function
from scenarionet_sim.arrays.minmax import larger, smaller
from scenarionet_sim.cameras.draw import columns as at
from scenarionet_sim.cameras.draw.single_precision import rounded_down, single, single_of, singles
from scenarionet_sim.cameras.draw.structures import Item, Triple

BAY, STOREY = 3.2, 3.2
"""Typical width of the part of a wall with one window, and height of a storey [m]."""

FOUNDATION, ROOF = 0.5, 0.03
"""Depth of buildings in the ground [m], and share of their height above the walls."""

_PER_BAY, _PER_STOREY, _MIXER, _LOW_BITS, _BYTE, _SHIFT = map(np.int32, (79, 1047, 1009, 1023, 255, 3))
"""Of random numbers of windows."""

FINEST = 0.2
"""Height of pixels [storeys] from which on a building has one colour, the mean of its walls and windows."""

PER_U, FIRST_U, PER_V, FIRST_V, BAYS, STYLE = 1, 2, 4, 5, 7, 8
"""Columns of a wall: bays per metre along it, and the bay before the camera; storeys per metre, and that at the height
of the camera; number of bays, 0 where windows are not drawn, and what the wall is like."""


@device_function(divides_by_zero=True)
def lay_out_wall(item: Item, pose: Float64, focal_length: float, colors: Float32) -> None:
    """Write the layout of a wall, whose light and normal are in ``colors`` (12,)."""
    box, (cos, sin) = item.box, item.turn
    nx, ny = float(colors[9]), float(colors[10])
    width = box[5] if abs(cos * nx + sin * ny) > 0.7 else box[4]
    height = (1.0 - ROOF) * box[6] - FOUNDATION
    bays, storeys = max(math.floor(width / BAY + 0.5), 1.0), max(math.floor(height / STOREY + 0.5), 1.0)
    x, y, z = pose[at.EYE] - box[0], pose[at.EYE + 1] - box[1], pose[at.EYE + 2] - box[2] - FOUNDATION
    colors[PER_U], colors[PER_V] = bays / width, storeys / height
    colors[FIRST_U] = (nx * y - ny * x) * bays / width + 0.5 * bays
    colors[FIRST_V], colors[BAYS] = z * storeys / height, bays
    if math.hypot(x, y) - 0.5 * max(box[4], box[5]) > FINEST * STOREY * focal_length:
        colors[BAYS] = 0.0
    colors[STYLE] = math.floor(abs(box[4] * 7.0 + box[5] * 13.0)) % 8.0


@device_function(divides_by_zero=True, in_lanes=True)
def draw_wall(first: int, end: int, color: Float32, angle: float, light: Float64, shades: Float32) -> None:
    """Write the light of a wall in pixels of a row.

    Args:
        first, end: Pixels of the tile.
        color: Light, layout and normal of the wall.
        angle: Of a pixel [rad].
        light: Of the frame.
        shades: Memory of the tile.
    """
    rgb = shades[at.RED], shades[at.GREEN], shades[at.BLUE]
    if color[BAYS] > 0.0:
        rays = shades[at.DISTANCE], shades[at.RAY_X], shades[at.RAY_Y], shades[at.RAY_Z]
        _draw_windows(first, end, color, angle, light, rays, rgb)
        return
    for channel in range(3):
        wall, glass = color[3 * channel], single(0.25 * light[at.HORIZON + channel] + 0.15 * light[at.LAMPS])
        level, values = wall + 0.27 * (glass - wall), rgb[channel]
        for k in range(first, end):
            values[k] = level


@device_function(forceinline=True, divides_by_zero=True, in_lanes=True)
def _inside(depth: float, sharpness: float) -> float:
    """Return the part of a footprint, of which there are ``sharpness`` in a bay or storey, that is inside an edge."""
    return float(smaller(larger(depth * sharpness + 0.5, 0.0), 1.0))


@device_function(divides_by_zero=True, in_lanes=True)
def _draw_windows(
    first: int, end: int, color: Float32, angle: float, light: Float64,
    rays: tuple[Float32, Float32, Float32, Float32], rgb: Triple,
) -> None:  # fmt: skip
    """Write the light of a wall with its windows, doors, shops, signs and ledges."""
    (distances, xs, ys, zs), (reds, greens, blues) = rays, rgb
    wall_r, wall_g, wall_b = color[0], color[3], color[6]
    per_u, per_v, bays, style = color[PER_U], color[PER_V], color[BAYS], color[STYLE]
    nx, ny, start, level, middle = color[9], color[10], color[FIRST_U], color[FIRST_V], rounded_down(single(0.5) * bays)
    has_shops, first_chance = style < 5.0, np.int32(style) * _MIXER
    sky_r, sky_g, sky_b = singles(light, at.HORIZON)
    glow, per_angle = single(0.8 * light[at.LAMPS]), 1.0 / (angle * per_u)
    door_r, door_g, door_b = 0.25 * wall_r, 0.16 * wall_g, 0.11 * wall_b
    sign_r, sign_g = larger(0.2 * style - 0.15, 0.05) * (wall_r + glow), (0.12 + 0.06 * style) * (wall_g + glow)
    sign_b = (0.5 - 0.11 * style) * (wall_b + glow)
    for k in range(first, end):
        far = distances[k]
        u, v = start + far * (nx * ys[k] - ny * xs[k]) * per_u, level + far * zs[k] * per_v
        sharp = per_angle / far
        fine_u, fine_v = sharp * abs(nx * xs[k] + ny * ys[k]), sharp * (per_u / per_v)
        bay, storey = rounded_down(u), rounded_down(v)
        u, v = abs(u - bay - 0.5), v - storey
        is_low = storey < 1.0
        is_door, is_shop = is_low & (bay == middle), is_low & (bay != middle) & has_shops
        half = 0.20 if is_door else (0.42 if is_shop else 0.25)
        low, high = -0.5 if is_door else (0.16 if is_shop else 0.26), 0.72 if is_shop else 0.78
        across, up = half - u, smaller(v - low, high - v)
        frame = _inside(across + 0.035, fine_u) * _inside(up + 0.035, fine_v)
        pane = _inside(smaller(u - 0.012, across), fine_u) * _inside(up, fine_v)
        number = np.int32((np.int32(bay) * _PER_BAY + np.int32(storey) * _PER_STOREY + first_chance) & _LOW_BITS)
        chance = single_of(int(np.int32(np.int32(number * _MIXER) >> _SHIFT) & _BYTE)) * (1.0 / 255.0)
        band = _inside(0.08 - abs(v - 0.88) if is_shop else 0.03 - v, fine_v)
        shine = glow if (chance > 0.62) | is_shop else 0.0
        mirror = 0.10 + 0.25 * chance
        glass_r = door_r if is_door else mirror * sky_r + shine
        glass_g = door_g if is_door else mirror * sky_g + 0.70 * shine
        glass_b = door_b if is_door else mirror * sky_b + 0.34 * shine
        sign, ledge = band if is_shop else 0.0, 0.0 if is_shop else 0.25 * band
        trim = (1.0 - sign) * (1.0 - ledge) * (0.72 if is_low & (v < 0.1) else 1.0) * (1.0 + 0.35 * frame)
        r, g, b = wall_r * trim + sign * sign_r, wall_g * trim + sign * sign_g, wall_b * trim + sign * sign_b
        reds[k], greens[k], blues[k] = r + pane * (glass_r - r), g + pane * (glass_g - g), b + pane * (glass_b - b)
