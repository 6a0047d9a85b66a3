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
from scenarionet_sim.cameras.draw.structures import Item

BAY, STOREY = 3.2, 3.2
"""Typical width of the part of a wall with one window, and height of a storey [m]."""

FOUNDATION, ROOF = 0.5, 0.03
"""Depth of buildings in the ground [m], and share of their height above the walls."""

PER_U, FIRST_U, PER_V, FIRST_V, BAYS, STYLE = 1, 2, 4, 5, 7, 8
"""Columns of a wall: bays per metre along it, and the bay before the camera; storeys per metre, and that at the height
of the camera; number of bays, and what the wall is like."""


@device_function(divides_by_zero=True)
def lay_out_wall(item: Item, pose: Float64, colors: Float32) -> None:
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
    colors[STYLE] = math.floor(abs(box[4] * 7.0 + box[5] * 13.0)) % 8.0


@device_function(forceinline=True, divides_by_zero=True, in_lanes=True)
def _within(place: float, first: float, end: float, footprint: float) -> float:
    """Return the part of a footprint that is between two places."""
    return float(smaller(larger(smaller(place - first, end - place) / footprint + 0.5, 0.0), 1.0))


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
    distances, xs, ys, zs = shades[at.DISTANCE], shades[at.RAY_X], shades[at.RAY_Y], shades[at.RAY_Z]
    reds, greens, blues = shades[at.RED], shades[at.GREEN], shades[at.BLUE]
    wall_r, wall_g, wall_b = color[0], color[3], color[6]
    nx, ny, per_u, per_v, bays, style = color[9], color[10], color[PER_U], color[PER_V], color[BAYS], color[STYLE]
    start, level, middle = color[FIRST_U], color[FIRST_V], rounded_down(single(0.5) * bays)
    has_shops = 1.0 if style < 5.0 else 0.0
    sky_r, sky_g, sky_b = singles(light, at.HORIZON)
    glow, dim = single(0.8 * light[at.LAMPS]), single(0.06)
    sign_r, sign_g, sign_b = 0.25 + 0.2 * (style - 2.0), 0.12 + 0.06 * style, 0.5 - 0.11 * style
    for k in range(first, end):
        far = distances[k]
        u, v = start + far * (nx * ys[k] - ny * xs[k]) * per_u, level + far * zs[k] * per_v
        facing = larger(abs(nx * xs[k] + ny * ys[k]), 0.05)
        wide, tall = far * angle * per_u / facing + 1e-4, far * angle * per_v + 1e-4
        bay, storey = rounded_down(u), rounded_down(v)
        u, v = u - bay, v - storey
        is_low = storey < 1.0
        is_door, is_shop = is_low & (bay == middle), is_low & (bay != middle) & (has_shops > 0.0)
        side = 0.30 if is_door else (0.08 if is_shop else 0.25)
        low, high = -0.5 if is_door else (0.16 if is_shop else 0.26), 0.72 if is_shop else 0.78
        frame = _within(u, side - 0.035, 1.035 - side, wide) * _within(v, low - 0.035, high + 0.035, tall)
        pane = _within(u, side, 1.0 - side, wide) * _within(v, low, high, tall)
        pane *= 1.0 - _within(u, 0.485, 0.515, wide) * (0.0 if is_shop else 0.8)
        number = (np.int32(bay) * np.int32(7919) + np.int32(storey) * np.int32(104729)) + np.int32(style) * np.int32(31)
        number = (number * np.int32(1103515245) + np.int32(12345)) & np.int32(0xFF0000)
        chance = single_of(int(number)) * (1.0 / 0xFF0000)
        band = _within(v, 0.80, 0.96, tall) * _within(u, 0.0, 1.0, wide) if is_shop else _within(v, -0.03, 0.03, tall)
        plinth = 0.72 if (is_low & (v < 0.1)) else 1.0
        shine = glow if (chance > 0.62) | is_shop else 0.0
        shine = 0.0 if is_door else shine
        mirror = 0.10 + 0.25 * chance
        glass_r = 0.25 * wall_r if is_door else dim * wall_r + mirror * sky_r + shine
        glass_g = 0.16 * wall_g if is_door else dim * wall_g + mirror * sky_g + 0.70 * shine
        glass_b = 0.11 * wall_b if is_door else dim * wall_b + mirror * sky_b + 0.34 * shine
        shop = band if is_shop else 0.0
        ledge = 1.0 - (0.0 if is_shop else 0.25 * band)
        trim = ledge * plinth * (1.0 + 0.35 * frame)
        r = wall_r * trim * (1.0 - shop) + shop * (larger(sign_r, 0.05) * (wall_r + glow))
        g = wall_g * trim * (1.0 - shop) + shop * (larger(sign_g, 0.05) * (wall_g + glow))
        b = wall_b * trim * (1.0 - shop) + shop * (larger(sign_b, 0.05) * (wall_b + glow))
        reds[k], greens[k], blues[k] = r + pane * (glass_r - r), g + pane * (glass_g - g), b + pane * (glass_b - b)
