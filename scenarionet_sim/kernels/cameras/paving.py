"""The colour of the ground along a row: asphalt, pavement, grass and paint, over the footprints of pixels."""

from __future__ import annotations

import math

import numpy as np

from scenarionet_data.arrays.compiled import device_function
from scenarionet_data.arrays.dtypes import Float32, Float64, Int32, UInt8
from scenarionet_sim.kernels.cameras.layout import (
    ACROSS,
    ALONG,
    BLUE,
    COARSE,
    CROSSWALK_BORDER,
    DISTANCE,
    FINE,
    GREEN,
    GROUND_X,
    GROUND_Y,
    HAS_STROKES,
    KERB,
    KERB_SHARE,
    ON_GROUND,
    ON_ROAD,
    ON_WALK,
    RAY_X,
    RAY_Y,
    RAY_Z,
    RED,
    ROAD,
    ROAD_BORDER,
    ROAD_EDGE,
    SHADE,
    SHIFT,
    SIDEWALK,
    SKYLIGHT,
    SUN,
    SUNLIGHT,
    UNIT,
    WALK_EDGE,
    WET,
    WHITE,
    WHITE_SHARE,
    YELLOW,
    YELLOW_SHARE,
    Ground,
)
from scenarionet_sim.kernels.cameras.sky import GRAIN_SIZE, sky_gradient, smooth_noise
from scenarionet_sim.kernels.minmax import larger, smaller

_BITS, _MASK = GRAIN_SIZE.bit_length() - 1, GRAIN_SIZE - 1


@device_function(divides_by_zero=True)
def color_ground(
    count: int, slot: int, angle: float, ground: Ground, light: Float64, grain: UInt8, seen: Int32,
    cells: Int32, texels: Int32, values: Float64,
) -> None:  # fmt: skip
    """Write the light of the ground where it is seen.

    Args:
        count: Columns of the tile.
        slot: World.
        angle: Between the rays of neighbouring pixels [rad].
        ground, light, grain: Ground and light.
        seen, cells, texels, values: Memory of the tile.
    """
    is_ground = False
    for k in range(count):
        is_ground |= seen[k] == ON_GROUND
    if not is_ground:
        return
    for k in range(count):
        values[ACROSS, k] = values[DISTANCE, k] * angle
    for k in range(count):
        values[ALONG, k] = smaller(values[ACROSS, k] * values[UNIT, k] / larger(-values[RAY_Z, k], 1e-3), 30.0)
    _find_cells(count, ground.frame[slot], int(ground.place[slot, 0]), cells, values)
    _read_noise(count, int(light[SHIFT]), grain, texels, values)
    has_strokes = has_walk = False
    for k in range(count):
        bits = int(ground.corner[cells[k]]) if cells[k] >= 0 and seen[k] == ON_GROUND else 0
        values[ON_ROAD, k] = bits & ROAD
        values[ON_WALK, k] = (bits & SIDEWALK) >> 1
        has_walk |= (bits & SIDEWALK) > 0
        if bits < HAS_STROKES:
            cells[k] = -1
        else:
            has_strokes = True
    if has_strokes:
        has_walk = True
        for row in range(WHITE_SHARE, KERB_SHARE + 1):
            for k in range(count):
                values[row, k] = 0.0
        _draw_strokes(count, ground, slot, cells, values)
    _blend(count, has_walk, has_strokes, light, seen, values)
    if light[WET] > 0.0:
        for k in range(count):
            if seen[k] == ON_GROUND:
                red, green, blue = wet_color(
                    light, grain, values[GROUND_X, k], values[GROUND_Y, k], values[RAY_Z, k] / values[UNIT, k],
                    values[RED, k], values[GREEN, k], values[BLUE, k],
                )  # fmt: skip
                values[RED, k], values[GREEN, k], values[BLUE, k] = red, green, blue


@device_function(divides_by_zero=True)
def _find_cells(count: int, frame: Float64, base: int, cells: Int32, values: Float64) -> None:
    """Write the cell of each pixel, or -1 beyond the grid."""
    low_x, low_y, inverse, columns, rows = frame[0], frame[1], 1.0 / frame[2], frame[3], frame[4]
    for k in range(count):
        u, v = (values[GROUND_X, k] - low_x) * inverse, (values[GROUND_Y, k] - low_y) * inverse
        is_inside = u >= 0.0 and v >= 0.0 and u < columns and v < rows
        place = math.floor(smaller(larger(v, 0.0), rows)) * columns + math.floor(smaller(larger(u, 0.0), columns))
        cells[k] = np.int32(place + base) if is_inside else np.int32(-1)


@device_function(divides_by_zero=True)
def _read_noise(count: int, shift: int, grain: UInt8, texels: Int32, values: Float64) -> None:
    """Write fine noise, which fades with the footprint, and coarse noise, both around 0."""
    for k in range(count):
        values[FINE, k] = larger(1.0 - 6.0 * (values[ALONG, k] + values[ACROSS, k]), 0.0)
    if larger(values[FINE, 0], values[FINE, count - 1]) > 0.0:
        _list_texels(count, 40.0, shift, texels, values)
        for k in range(count):
            values[COARSE, k] = grain[0, texels[k] >> _BITS, texels[k] & _MASK]
        for k in range(count):
            values[FINE, k] *= values[COARSE, k] * (1.0 / 255.0) - 0.5
    _list_texels(count, 7.0, shift, texels, values)
    for k in range(count):
        values[COARSE, k] = grain[1, texels[k] >> _BITS, texels[k] & _MASK]
    for k in range(count):
        strength = larger(1.0 - 0.1 * values[ALONG, k], 0.15)
        values[COARSE, k] = (values[COARSE, k] * (1.0 / 255.0) - 0.5) * strength


@device_function(divides_by_zero=True)
def _list_texels(count: int, scale: float, shift: int, texels: Int32, values: Float64) -> None:
    """Write row and column of each pixel's texel in one number."""
    offset = np.int32(shift)
    for k in range(count):
        column = np.int32(values[GROUND_X, k] * scale + 1e6) + offset
        row = np.int32(values[GROUND_Y, k] * scale + 1e6) + offset
        texels[k] = (row & _MASK) << _BITS | (column & _MASK)


@device_function(divides_by_zero=True)
def _draw_strokes(count: int, ground: Ground, slot: int, cells: Int32, values: Float64) -> None:
    """Write the shares of road, pavement and paint in the pixels of cells with strokes, a run in one cell at a time.

    The direction of view and the footprint are those in the middle of the run.
    """
    k = 0
    while k < count:
        cell = cells[k]
        if cell < 0:
            k += 1
            continue
        run = k + 1
        while run < count and cells[run] == cell:
            run += 1
        middle = (k + run) // 2
        vx, vy = values[RAY_X, middle], values[RAY_Y, middle]
        flat = 1.0 / math.sqrt(vx * vx + vy * vy + 1e-12)
        vx, vy = vx * flat, vy * flat
        across, along = values[ACROSS, middle], values[ALONG, middle]
        has_borders = False
        for n in range(ground.cell_start[cell], ground.cell_start[cell + 1]):
            kind = ground.stroke_kind[n]
            if kind >= WHITE:
                target = WHITE_SHARE + (1 if kind == YELLOW else (2 if kind == KERB else 0))
                _paint(
                    ground.strokes[n], vx, vy, across, along, values[GROUND_X, k:run], values[GROUND_Y, k:run],
                    values[target, k:run],
                )  # fmt: skip
            elif kind != CROSSWALK_BORDER:
                if not has_borders:
                    has_borders = True
                    for j in range(k, run):
                        values[ROAD_EDGE, j] = 1e9
                        values[WALK_EDGE, j] = 1e9
                side = 0 if kind == ROAD_BORDER else 1
                _cross(
                    ground.strokes[n], ground.frame[slot], cell - int(ground.place[slot, 0]), vx, vy, across, along,
                    values[GROUND_X, k:run], values[GROUND_Y, k:run], values[ON_ROAD + side, k:run],
                    values[ROAD_EDGE + side, k:run],
                )  # fmt: skip
        if has_borders:
            for side in range(2):
                near, share = values[ROAD_EDGE + side, k:run], values[ON_ROAD + side, k:run]
                for j in range(run - k):
                    share[j] += larger(0.5 - near[j], 0.0) * (1.0 - 2.0 * share[j])
        k = run


@device_function(forceinline=True, divides_by_zero=True)
def _paint(
    stroke: Float32, vx: float, vy: float, across: float, along: float, xs: Float64, ys: Float64, shares: Float64
) -> None:
    """Cover a run of pixels at points of the ground with a painted rectangle."""
    x0, y0, ux, uy = stroke[0] * 1.0, stroke[1] * 1.0, stroke[2] * 1.0, stroke[3] * 1.0
    straight, beside = abs(ux * vx + uy * vy), abs(ux * vy - uy * vx)
    wide, deep = straight * across + beside * along + 1e-6, straight * along + beside * across + 1e-6
    half, half_length, last = stroke[5] * 1.0, 0.5 * stroke[4], len(xs) - 1
    limit = half + 0.5 * wide
    left, right = (ys[0] - y0) * ux - (xs[0] - x0) * uy, (ys[last] - y0) * ux - (xs[last] - x0) * uy
    if smaller(left, right) > limit or larger(left, right) < -limit:
        return
    limit = half_length + 0.5 * deep
    rear = (xs[0] - x0) * ux + (ys[0] - y0) * uy - half_length
    front = (xs[last] - x0) * ux + (ys[last] - y0) * uy - half_length
    if smaller(rear, front) > limit or larger(rear, front) < -limit:
        return
    per_area = 1.0 / (wide * deep)
    for k in range(len(xs)):
        dx, dy = xs[k] - x0, ys[k] - y0
        off, on = dy * ux - dx * uy, dx * ux + dy * uy - half_length
        part = smaller(off + 0.5 * wide, half) - larger(off - 0.5 * wide, -half)
        rest = smaller(on + 0.5 * deep, half_length) - larger(on - 0.5 * deep, -half_length)
        shares[k] = larger(shares[k], larger(part, 0.0) * larger(rest, 0.0) * per_area)


@device_function(forceinline=True, divides_by_zero=True)
def _cross(
    stroke: Float32, frame: Float64, number: int, vx: float, vy: float, across: float, along: float, xs: Float64,
    ys: Float64, shares: Float64, edges: Float64,
) -> None:  # fmt: skip
    """Change the surface at the pixels of a run beyond a border, and write their distance to it in footprints.

    Beyond means that the way from the corner of the cell, first along y and then along x, crosses the border.
    """
    columns = int(frame[3])
    corner_x, corner_y = frame[0] + frame[2] * (number % columns), frame[1] + frame[2] * (number // columns)
    x0, y0, x1, y1 = stroke[0] * 1.0, stroke[1] * 1.0, stroke[2] * 1.0, stroke[3] * 1.0
    ex, ey = x1 - x0, y1 - y0
    above = math.inf  # a crossing of the cell's left side changes all points above it
    if (x0 <= corner_x) != (x1 <= corner_x):
        crossing = y0 + (corner_x - x0) / ex * ey
        above = crossing if corner_y < crossing else math.inf
    per_y = ex / ey if ey != 0.0 else 0.0
    low, high = smaller(y0, y1), larger(y0, y1)
    for k in range(len(xs)):
        crossing = x0 + (ys[k] - y0) * per_y
        is_right = (low <= ys[k]) & (ys[k] < high) & (corner_x < crossing) & (crossing <= xs[k])
        before = shares[k]
        shares[k] = 1.0 - before if is_right != (above <= ys[k]) else before
    length = math.sqrt(ex * ex + ey * ey + 1e-12)
    ux, uy = ex / length, ey / length
    straight = abs(ux * vx + uy * vy)
    per = 1.0 / (straight * across + math.sqrt(larger(1.0 - straight * straight, 0.0)) * along + 1e-6)
    for k in range(len(xs)):
        dx, dy = xs[k] - x0, ys[k] - y0
        at = dx * ux + dy * uy
        far = abs(dy * ux - dx * uy) * per
        edges[k] = smaller(edges[k], far if (at >= -0.3) & (at <= length + 0.3) else 1e9)


@device_function(divides_by_zero=True)
def _blend(count: int, has_walk: bool, has_paint: bool, light: Float64, seen: Int32, values: Float64) -> None:
    """Write the light of the ground by its shares: terrain, pavement, road, kerb, then paint, which is worn."""
    for k in range(count):
        grass = 1.0 + 0.5 * values[COARSE, k] + 0.87 * values[FINE, k]
        values[ROAD_EDGE, k] = (1.0 - values[ON_ROAD, k]) * (1.0 - values[ON_WALK, k]) * grass
    if has_walk:
        for k in range(count):
            x, y = values[GROUND_X, k] * (1.0 / 1.5), values[GROUND_Y, k] * (1.0 / 1.5)
            is_joint = (x - math.floor(x) < 0.0167) | (y - math.floor(y) < 0.0167)
            slab = 0.72 if is_joint & (values[ALONG, k] < 0.3) else 1.0
            slab *= 1.0 + 0.12 * values[COARSE, k] + 0.25 * values[FINE, k]
            values[ON_WALK, k] *= (1.0 - values[ON_ROAD, k]) * slab
    for k in range(count):
        values[ON_ROAD, k] *= 1.0 + 0.22 * values[COARSE, k] + 0.75 * values[FINE, k]
    if has_paint:
        for k in range(count):
            worn = 1.0 - 0.25 * larger(values[COARSE, k] + 0.2, 0.0) - 0.5 * larger(values[FINE, k], 0.0)
            white, yellow = values[WHITE_SHARE, k] * worn, values[YELLOW_SHARE, k] * worn
            values[YELLOW_SHARE, k] = yellow
            values[WHITE_SHARE, k] = white * (1.0 - yellow)
            values[ALONG, k] = (1.0 - white) * (1.0 - yellow)
        for k in range(count):
            values[ACROSS, k] = values[ALONG, k] * (1.0 - values[KERB_SHARE, k])
        for k in range(count):
            values[KERB_SHARE, k] *= values[ALONG, k]
        for row in (ROAD_EDGE, ON_WALK, ON_ROAD):
            for k in range(count):
                values[row, k] *= values[ACROSS, k]
    for channel in range(3):
        grass = 0.115 if channel == 0 else (0.150 if channel == 1 else 0.048)
        slab = 0.34 if channel == 0 else (0.3298 if channel == 1 else 0.3128)
        asphalt = 0.082 if channel == 0 else (0.08282 if channel == 1 else 0.0861)
        kerb = 0.40 if channel == 0 else (0.39 if channel == 1 else 0.37)
        white = 0.72 if channel == 2 else 0.74
        yellow = 0.68 if channel == 0 else (0.43 if channel == 1 else 0.05)
        sun, sky = light[SUNLIGHT + channel] * light[SUN + 2], light[SKYLIGHT + channel] + 0.0
        direct, ambient = sun + 0.45 * sky, 0.55 * sky
        for k in range(count):
            tone = grass * values[ROAD_EDGE, k] + slab * values[ON_WALK, k] + asphalt * values[ON_ROAD, k]
            bright = tone * (direct * values[SHADE, k] + ambient)
            before = values[RED + channel, k]
            values[RED + channel, k] = bright if seen[k] == ON_GROUND else before
        if has_paint:
            for k in range(count):
                tone = white * values[WHITE_SHARE, k] + yellow * values[YELLOW_SHARE, k] + kerb * values[KERB_SHARE, k]
                bright = tone * (direct * values[SHADE, k] + ambient)
                values[RED + channel, k] += bright if seen[k] == ON_GROUND else 0.0


@device_function(divides_by_zero=True)
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
