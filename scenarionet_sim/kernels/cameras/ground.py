"""The ground: its height, its surface at a point, and its colour over the footprint of a pixel."""

from __future__ import annotations

import math

from scenarionet_data.arrays.compiled import device_function, kernel
from scenarionet_data.arrays.dtypes import Float32, Float64, Int64, UInt8
from scenarionet_sim.kernels.cameras.layout import (
    CROSSWALK_BORDER,
    HAS_STROKES,
    KERB,
    ROAD,
    ROAD_BORDER,
    SHIFT,
    SIDEWALK,
    SKYLIGHT,
    SUN,
    SUNLIGHT,
    WET,
    WHITE,
    YELLOW,
    Ground,
)
from scenarionet_sim.kernels.cameras.sky import GRAIN_SIZE, sky_gradient, smooth_noise
from scenarionet_sim.kernels.minmax import larger, smaller

MARGIN = 0.25
"""Strokes are in all cells closer than this [m]."""


@device_function(forceinline=True, divides_by_zero=True)
def height_at(ground: Ground, slot: int, x: float, y: float) -> float:
    """Return the height of the ground [m], bilinear between the corners of its cells and constant beyond the grid."""
    frame = ground.height_frame[slot]
    columns, rows = int(frame[3]), int(frame[4])
    if columns == 0:
        return float(ground.level[slot])
    u = smaller(larger((x - frame[0]) / frame[2], 0.0), columns - 1.0)
    v = smaller(larger((y - frame[1]) / frame[2], 0.0), rows - 1.0)
    column, row = smaller(int(u), columns - 2), smaller(int(v), rows - 2)
    u, v = u - column, v - row
    first = ground.place[slot, 1] + row * columns + column
    below = ground.heights[first] * (1.0 - u) + ground.heights[first + 1] * u
    above = ground.heights[first + columns] * (1.0 - u) + ground.heights[first + columns + 1] * u
    return float(below * (1.0 - v) + above * v)


@device_function(divides_by_zero=True)
def meet_heights(
    ground: Ground, slot: int, x: float, y: float, z: float, dx: float, dy: float, dz: float, reach: float
) -> float:
    """Return how far along a direction a ray first meets uneven ground; infinite if it does not within ``reach``."""
    flat = math.hypot(dx, dy)
    before, above = 0.0, z - height_at(ground, slot, x, y)
    if above <= 0.0 or flat < 1e-9:
        return 0.0 if above <= 0.0 else (above / -dz if dz < 0.0 else math.inf)
    length = math.sqrt(flat * flat + dz * dz)
    along = before
    while along * length < reach:
        along = before + larger(larger(0.5, 0.02 * before * length), 0.5 * above) / length
        gap = z + along * dz - height_at(ground, slot, x + along * dx, y + along * dy)
        if gap <= 0.0:
            for _ in range(30):  # halves the interval, or better
                middle = before + (along - before) * smaller(larger(above / (above - gap), 0.02), 0.98)
                here = z + middle * dz - height_at(ground, slot, x + middle * dx, y + middle * dy)
                if abs(here) < 1e-5:
                    return middle
                if here > 0.0:
                    before, above = middle, here
                else:
                    along, gap = middle, here
            return along
        before, above = along, gap
    return math.inf


@device_function(forceinline=True, divides_by_zero=True)
def cell_of(ground: Ground, slot: int, x: float, y: float) -> int:
    """Return the cell at a point, or -1 beyond the grid."""
    frame = ground.frame[slot]
    u, v = (x - frame[0]) / frame[2], (y - frame[1]) / frame[2]
    if not (u >= 0.0 and v >= 0.0 and u < frame[3] and v < frame[4]):
        return -1
    return int(ground.place[slot, 0]) + int(v) * int(frame[3]) + int(u)


@device_function(forceinline=True, divides_by_zero=True)
def surface_at(ground: Ground, slot: int, cell: int, x: float, y: float) -> int:
    """Return the surface bits at a point of a cell: those of its corner, changed at every border on the way there."""
    bits = int(ground.corner[cell])
    frame = ground.frame[slot]
    number = cell - ground.place[slot, 0]
    columns = int(frame[3])
    corner_x = frame[0] + frame[2] * (number % columns)
    corner_y = frame[1] + frame[2] * (number // columns)
    for k in range(ground.cell_start[cell], ground.cell_start[cell + 1]):
        kind = ground.stroke_kind[k]
        if kind > CROSSWALK_BORDER:
            continue
        x0, y0 = ground.strokes[k, 0] * 1.0, ground.strokes[k, 1] * 1.0
        x1, y1 = ground.strokes[k, 2] * 1.0, ground.strokes[k, 3] * 1.0
        if (x0 <= corner_x) != (x1 <= corner_x):
            crossing = y0 + (corner_x - x0) / (x1 - x0) * (y1 - y0)
            if corner_y < crossing <= y:
                bits ^= 1 << kind
        if (y0 <= y) != (y1 <= y):
            crossing = x0 + (y - y0) / (y1 - y0) * (x1 - x0)
            if corner_x < crossing <= x:
                bits ^= 1 << kind
    return bits


@device_function(forceinline=True, divides_by_zero=True)
def covered(distance: float, half: float, footprint: float) -> float:
    """Return the share of an interval of length ``footprint`` around ``distance`` that is in [-half, half]."""
    low = larger(distance - 0.5 * footprint, -half)
    high = smaller(distance + 0.5 * footprint, half)
    return smaller(larger((high - low) / footprint, 0.0), 1.0)


@device_function(forceinline=True, divides_by_zero=True)
def paint_at(ground: Ground, cell: int, x: float, y: float) -> int:
    """Return the kind of the last painted stroke that contains a point, or -1."""
    found = -1
    for k in range(ground.cell_start[cell], ground.cell_start[cell + 1]):
        if ground.stroke_kind[k] >= WHITE:
            stroke = ground.strokes[k]
            dx, dy = x - stroke[0], y - stroke[1]
            along, beside = dx * stroke[2] + dy * stroke[3], dy * stroke[2] - dx * stroke[3]
            if 0.0 <= along <= stroke[4] and abs(beside) <= stroke[5]:
                found = int(ground.stroke_kind[k])
    return found


@device_function(forceinline=True, divides_by_zero=True)
def ground_color(
    ground: Ground, light: Float64, grain: UInt8, slot: int, cell: int, x: float, y: float, vx: float, vy: float,
    across: float, along: float, shade: float,
) -> tuple[float, float, float]:  # fmt: skip
    """Return the light that the ground sends to the camera.

    Args:
        ground, light, grain, slot, cell: Ground and light.
        x, y: Point [m].
        vx, vy: Horizontal part of the direction of view, of any length.
        across, along: Extent of the pixel's footprint across and along that direction [m].
        shade: Share of sunlight that arrives.
    """
    shift = int(light[SHIFT])
    fine = larger(1.0 - 6.0 * (along + across), 0.0)
    if fine > 0.0:
        column, row = int(x * 40.0 + 1e6) + shift, int(y * 40.0 + 1e6) + shift
        fine *= grain[0, row & (GRAIN_SIZE - 1), column & (GRAIN_SIZE - 1)] * (1.0 / 255.0) - 0.5
    column, row = int(x * 7.0 + 1e6) + shift, int(y * 7.0 + 1e6) + shift
    coarse = grain[1, row & (GRAIN_SIZE - 1), column & (GRAIN_SIZE - 1)] * (1.0 / 255.0) - 0.5
    coarse *= larger(1.0 - 0.1 * along, 0.15)
    bits = 0 if cell < 0 else int(ground.corner[cell])
    has_strokes = bits >= HAS_STROKES
    road = on_walk = 0.0
    if has_strokes:
        bits = surface_at(ground, slot, cell, x, y)
        flat = 1.0 / math.sqrt(vx * vx + vy * vy + 1e-12)
        vx, vy = vx * flat, vy * flat
    if bits & ROAD:
        road = 1.0
    if bits & SIDEWALK:
        on_walk = 1.0
    white = yellow = kerb = 0.0
    if has_strokes:
        nearest_road, nearest_walk = 1e9, 1e9
        for k in range(ground.cell_start[cell], ground.cell_start[cell + 1]):
            kind, stroke = ground.stroke_kind[k], ground.strokes[k]
            if kind >= WHITE:
                dx, dy = x - stroke[0], y - stroke[1]
                ux, uy = stroke[2] * 1.0, stroke[3] * 1.0
                straight, beside = abs(ux * vx + uy * vy), abs(ux * vy - uy * vx)
                wide = straight * across + beside * along + 1e-6
                part = covered(dy * ux - dx * uy, stroke[5] * 1.0, wide)
                if part > 0.0:
                    half = 0.5 * stroke[4]
                    part *= covered(dx * ux + dy * uy - half, half, straight * along + beside * across + 1e-6)
                    if kind == YELLOW:
                        yellow = larger(yellow, part)
                    elif kind == KERB:
                        kerb = larger(kerb, part)
                    else:
                        white = larger(white, part)
            elif kind != CROSSWALK_BORDER:
                ex, ey = stroke[2] - stroke[0], stroke[3] - stroke[1]
                length = math.sqrt(ex * ex + ey * ey + 1e-12)
                at = ((x - stroke[0]) * ex + (y - stroke[1]) * ey) / length
                if -0.3 <= at <= length + 0.3:
                    far = abs((y - stroke[1]) * ex - (x - stroke[0]) * ey) / length
                    straight = abs(ex * vx + ey * vy) / length
                    far /= straight * across + math.sqrt(larger(1.0 - straight * straight, 0.0)) * along + 1e-6
                    if kind == ROAD_BORDER:
                        nearest_road = smaller(nearest_road, far)
                    else:
                        nearest_walk = smaller(nearest_walk, far)
        if nearest_road < 0.5:
            road += (0.5 - nearest_road) * (1.0 - 2.0 * road)
        if nearest_walk < 0.5:
            on_walk += (0.5 - nearest_walk) * (1.0 - 2.0 * on_walk)
    red = green = blue = 0.0
    if road < 1.0:
        red = 0.115 * (1.0 + 0.55 * coarse + 0.9 * fine)
        green = 0.150 * (1.0 + 0.40 * coarse + 0.8 * fine)
        blue = 0.048 * (1.0 + 0.55 * coarse + 0.9 * fine)
        if on_walk > 0.0:
            tone = 0.34 * (1.0 + 0.12 * coarse + 0.25 * fine)
            if along < 0.3:
                u, v = x - 1.5 * math.floor(x / 1.5), y - 1.5 * math.floor(y / 1.5)
                tone *= 0.72 if u < 0.025 or v < 0.025 else 1.0
            red += on_walk * (tone - red)
            green += on_walk * (0.97 * tone - green)
            blue += on_walk * (0.92 * tone - blue)
    if road > 0.0:
        tone = 0.082 * (1.0 + 0.22 * coarse + 0.75 * fine)
        red += road * (tone - red)
        green += road * (1.01 * tone - green)
        blue += road * (1.05 * tone - blue)
    if kerb > 0.0:
        red, green, blue = red + kerb * (0.40 - red), green + kerb * (0.39 - green), blue + kerb * (0.37 - blue)
    if white > 0.0 or yellow > 0.0:
        worn = 1.0 - 0.25 * larger(coarse + 0.2, 0.0) - 0.5 * larger(fine, 0.0)
        white, yellow = white * worn, yellow * worn
        red, green, blue = red + white * (0.74 - red), green + white * (0.74 - green), blue + white * (0.72 - blue)
        red, green, blue = red + yellow * (0.68 - red), green + yellow * (0.43 - green), blue + yellow * (0.05 - blue)
    height = light[SUN + 2] * shade
    ambient = 0.55 + 0.45 * shade
    red *= light[SUNLIGHT] * height + light[SKYLIGHT] * ambient
    green *= light[SUNLIGHT + 1] * height + light[SKYLIGHT + 1] * ambient
    blue *= light[SUNLIGHT + 2] * height + light[SKYLIGHT + 2] * ambient
    return red, green, blue


@device_function(forceinline=True, divides_by_zero=True)
def wet_color(
    light: Float64, grain: UInt8, x: float, y: float, dz: float, red: float, green: float, blue: float
) -> tuple[float, float, float]:
    """Return the light of a wet road, which mirrors the sky, in a direction of view (unit vector)."""
    wet = light[WET] * (0.55 + 0.9 * (smooth_noise(grain, 1.3 * x, 1.3 * y) - 0.35))
    wet = smaller(larger(wet, 0.0), 1.0)
    rest = 1.0 - smaller(-dz, 1.0)
    share = wet * (0.03 + 0.75 * rest * rest * rest * rest * rest)
    sky = sky_gradient(light, -dz)
    dark = 1.0 - 0.45 * wet
    return (
        red * dark + share * (sky[0] - red * dark),
        green * dark + share * (sky[1] - green * dark),
        blue * dark + share * (sky[2] - blue * dark),
    )


@kernel
def fill_corners(edges: Float64, bit: int, frame: Float64, corner: UInt8) -> None:
    """Set a bit at the lower left corners of the cells inside outlines given by their edges (E, 4), by parity.

    Args:
        edges: Edges x0, y0, x1, y1 [m] of all outlines.
        bit: Bit to set.
        frame: (5,) see ``Ground.frame``.
        corner: (C,) output.
    """
    columns, rows = int(frame[3]), int(frame[4])
    for e in range(len(edges)):
        x0, y0, x1, y1 = edges[e]
        first = int(larger(math.ceil((smaller(y0, y1) - frame[1]) / frame[2]) - 1.0, 0.0))
        last = int(smaller(math.floor((larger(y0, y1) - frame[1]) / frame[2]) + 1.0, rows - 1.0))
        for row in range(first, last + 1):
            y = frame[1] + frame[2] * row
            if (y0 <= y) != (y1 <= y):
                x = x0 + (y - y0) / (y1 - y0) * (x1 - x0)
                column = int(larger(math.ceil((x - frame[0]) / frame[2]), 0.0))
                if column < columns:
                    corner[row * columns + column] ^= bit
    for row in range(rows):
        inside = 0
        for column in range(columns):
            inside ^= int(corner[row * columns + column]) & bit
            kept = int(corner[row * columns + column]) & ~bit
            corner[row * columns + column] = kept | inside


@kernel
def list_strokes(
    strokes: Float32, kinds: UInt8, frame: Float64, starts: Int64, items: Int64, is_counting: bool
) -> None:
    """Count the strokes near every cell, or list them.

    Args:
        strokes, kinds: (S, 6), (S,) see the kinds of stroke.
        frame: (5,) see ``Ground.frame``.
        starts: (C + 1,) counts to add to at ``cell + 1``, or first free places, which move on.
        items: (K,) output when listing.
        is_counting: Whether to count.
    """
    columns, rows, side = int(frame[3]), int(frame[4]), frame[2]
    for s in range(len(strokes)):
        x0, y0 = strokes[s, 0] * 1.0, strokes[s, 1] * 1.0
        if kinds[s] >= WHITE:
            ux, uy, length, half = strokes[s, 2] * 1.0, strokes[s, 3] * 1.0, strokes[s, 4] * 1.0, strokes[s, 5] * 1.0
        else:
            ux, uy = strokes[s, 2] - x0, strokes[s, 3] - y0
            length, half = math.sqrt(ux * ux + uy * uy), 0.0
            ux, uy = ux / larger(length, 1e-9), uy / larger(length, 1e-9)
        reach = half + MARGIN
        x1, y1 = x0 + ux * length, y0 + uy * length
        first_column = int(larger(math.floor((smaller(x0, x1) - reach - frame[0]) / side), 0.0))
        last_column = int(smaller(math.floor((larger(x0, x1) + reach - frame[0]) / side), columns - 1.0))
        first_row = int(larger(math.floor((smaller(y0, y1) - reach - frame[1]) / side), 0.0))
        last_row = int(smaller(math.floor((larger(y0, y1) + reach - frame[1]) / side), rows - 1.0))
        extent = 0.5 * side * (abs(ux) + abs(uy)) + reach
        for row in range(first_row, last_row + 1):
            dy = frame[1] + (row + 0.5) * side - y0
            for column in range(first_column, last_column + 1):
                dx = frame[0] + (column + 0.5) * side - x0
                along, beside = dx * ux + dy * uy, dy * ux - dx * uy
                if -extent <= along <= length + extent and abs(beside) <= extent:
                    cell = row * columns + column
                    if is_counting:
                        starts[cell + 1] += 1
                    else:
                        items[starts[cell]] = s
                        starts[cell] += 1
