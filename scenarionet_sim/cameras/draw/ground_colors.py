"""The colour of the ground: asphalt, pavement, grass and paint, over the footprints of pixels."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from scenarionet_data.arrays.dtypes import Float32, Float64, Int32, UInt8
from scenarionet_data.compiled.decorators import device_function
from scenarionet_sim.arrays.minmax import larger, smaller
from scenarionet_sim.cameras.draw import codes
from scenarionet_sim.cameras.draw import columns as at
from scenarionet_sim.cameras.draw.ground_strokes import draw_strokes
from scenarionet_sim.cameras.draw.single_precision import rounded_down, single
from scenarionet_sim.cameras.draw.sky import GRAIN_SIZE, sky_gradient, smooth_noise
from scenarionet_sim.cameras.draw.structures import FrameView, Ground, Tile, Triple

_BITS, _MASK = np.int32(GRAIN_SIZE.bit_length() - 1), np.int32(GRAIN_SIZE - 1)
_ROAD, _SIDEWALK = np.int32(codes.ROAD), np.int32(codes.SIDEWALK)

FINE_TEXELS, COARSE_TEXELS = 40.0, 7.0
"""Texels per metre of the two tables of noise."""

EVERYWHERE = 256
"""More than all bits of surfaces."""

_AHEAD = 65600.0
"""Texels before the corner of the grid, more than any pixel sees: numbers of texels are positive."""


class Cover(NamedTuple):
    """Noise, sunlight and colour of pixels: the rows of ``FrameMemory.shades`` of these names."""

    fine: Float32
    coarse: Float32
    shade: Float32
    red: Float32
    green: Float32
    blue: Float32


@device_function(divides_by_zero=True)
def color_ground(view: FrameView, ground: Ground, grain: UInt8, tile: Tile) -> None:
    """Write the light of the ground for all pixels of a tile, of which some see it.

    Args:
        view, ground, grain: The camera, the ground and its noise.
        tile: Memory of the tile.
    """
    slot, light, seen, cells, texels, shades = view.slot, view.light, tile.seen, tile.cells, tile.texels, tile.shades
    frame, count, angle = ground.frame[slot], len(seen), 1.0 / view.lens[at.FX]
    is_near = _measure_footprints(
        count, single(angle), shades[at.DISTANCE], shades[at.RAY_Z], shades[at.FAR], shades[at.ACROSS], shades[at.ALONG]
    )
    _find_cells(count, frame, int(ground.place[slot, 0]), shades[at.GROUND_X], shades[at.GROUND_Y], cells)
    _read_noise(count, frame, light[at.SHIFT], grain, is_near, texels, shades)
    for k in range(count):
        texels[k] = ground.corner[np.uint32(cells[k])]
    surfaces = _list_surfaces(count, seen, texels, shades[at.ON_ROAD], shades[at.ON_WALK])
    is_all_road, surfaces = surfaces >= EVERYWHERE, surfaces % EVERYWHERE
    if surfaces >= codes.HAS_STROKES:
        for k in range(count):
            cells[k] = cells[k] if texels[k] >= codes.HAS_STROKES else -1
        draw_strokes(count, ground, slot, cells, shades)
    cover = Cover(
        shades[at.FINE], shades[at.COARSE], shades[at.SHADE], shades[at.RED], shades[at.GREEN], shades[at.BLUE]
    )
    if surfaces < codes.HAS_STROKES and (not surfaces & (codes.ROAD | codes.SIDEWALK) or is_all_road):
        _cover_evenly(count, light, is_all_road, cover)
    else:
        corner, spots = (frame[0] % 1.5, frame[1] % 1.5), (shades[at.GROUND_X], shades[at.GROUND_Y], shades[at.ALONG])
        _pave(count, light, corner, spots, shades[at.ON_ROAD], shades[at.ON_WALK], cover)
    if surfaces >= codes.HAS_STROKES:
        paint = shades[at.WHITE_SHARE], shades[at.YELLOW_SHARE], shades[at.KERB_SHARE]
        _paint_over(count, light, paint, shades[at.ON_ROAD], cover)
    if light[at.WET] > 0.0:
        _wet(light, frame, grain, seen, shades)


@device_function(divides_by_zero=True, in_lanes=True)
def _measure_footprints(
    count: int, angle: float, distances: Float32, zs: Float32, far: Float32, across: Float32, along: Float32
) -> bool:
    """Write the extents [m] of pixels on the ground; return whether one is small enough to see fine noise."""
    is_near = False
    for k in range(count):
        across[k] = distances[k] * angle
        along[k] = smaller(angle * far[k] / larger(-zs[k], 1e-3), 30.0)
        is_near |= across[k] + along[k] < 0.1666
    return is_near


@device_function(divides_by_zero=True, in_lanes=True)
def _find_cells(count: int, frame: Float64, base: int, xs: Float32, ys: Float32, cells: Int32) -> None:
    """Write the cell of each pixel; beyond the grid, the one behind its last, which is terrain."""
    inverse, columns, rows = single(1.0 / frame[2]), single(frame[3]), single(frame[4])
    first, last = np.int32(base), np.int32(base + int(frame[3]) * int(frame[4]))
    for k in range(count):
        u, v = xs[k] * inverse, ys[k] * inverse
        is_inside = (u >= 0.0) & (v >= 0.0) & (u < columns) & (v < rows)
        row, column = smaller(larger(v, 0.0), rows), smaller(larger(u, 0.0), columns)
        cell = np.int32(rounded_down(row) * columns + rounded_down(column))
        cells[k] = first + cell if is_inside else last


@device_function(divides_by_zero=True)
def _read_noise(
    count: int, frame: Float64, shift: float, grain: UInt8, is_near: bool, texels: Int32, shades: Float32
) -> None:
    """Write fine noise, which fades with the footprint, and coarse noise, both around 0."""
    fine, coarse, xs, ys = shades[at.FINE], shades[at.COARSE], shades[at.GROUND_X], shades[at.GROUND_Y]
    _fade(count, shades[at.ACROSS], shades[at.ALONG], fine)
    if is_near:
        _list_texels(count, FINE_TEXELS, frame, shift, xs, ys, texels)
        table = grain[0]
        for k in range(count):
            texels[k] = table[np.uint32(texels[k])]
        _center_fine(count, texels, fine)
    _list_texels(count, COARSE_TEXELS, frame, shift, xs, ys, texels)
    table = grain[1]
    for k in range(count):
        texels[k] = table[np.uint32(texels[k])]
    _center_coarse(count, texels, shades[at.ALONG], coarse)


@device_function(divides_by_zero=True, in_lanes=True)
def _fade(count: int, across: Float32, along: Float32, fine: Float32) -> None:
    """Write the strength of fine noise."""
    for k in range(count):
        fine[k] = larger(1.0 - 6.0 * (along[k] + across[k]), 0.0)


@device_function(divides_by_zero=True, in_lanes=True)
def _center_fine(count: int, levels: Int32, fine: Float32) -> None:
    for k in range(count):
        fine[k] *= single(levels[k]) * (1.0 / 255.0) - 0.5


@device_function(divides_by_zero=True, in_lanes=True)
def _center_coarse(count: int, levels: Int32, along: Float32, coarse: Float32) -> None:
    for k in range(count):
        coarse[k] = (single(levels[k]) * (1.0 / 255.0) - 0.5) * larger(1.0 - 0.1 * along[k], 0.15)


@device_function(divides_by_zero=True)
def _list_texels(
    count: int, scale: float, frame: Float64, shift: float, xs: Float32, ys: Float32, texels: Int32
) -> None:
    """Write the texel of each pixel."""
    _list_texels_from(
        count, single(scale), single((frame[0] * scale + shift) % GRAIN_SIZE + _AHEAD),
        single((frame[1] * scale + shift) % GRAIN_SIZE + _AHEAD), xs, ys, texels,
    )  # fmt: skip


@device_function(divides_by_zero=True, in_lanes=True)
def _list_texels_from(
    count: int, scale: float, first_x: float, first_y: float, xs: Float32, ys: Float32, texels: Int32
) -> None:
    for k in range(count):
        column, row = np.int32(xs[k] * scale + first_x), np.int32(ys[k] * scale + first_y)
        texels[k] = (row & _MASK) << _BITS | (column & _MASK)


@device_function(divides_by_zero=True, in_lanes=True)
def _list_surfaces(count: int, seen: Int32, bits: Int32, on_road: Float32, on_walk: Float32) -> int:
    """Write the shares of road and pavement at the corners of cells; return the bits of all cells together.

    ``EVERYWHERE`` is added if all of the ground that is seen is road.
    """
    found, common = np.int32(0), _ROAD
    for k in range(count):
        is_ground = seen[k] == codes.ON_GROUND
        here = bits[k] if is_ground else np.int32(0)
        bits[k] = here
        found = np.int32(found | here)
        common = np.int32(common & (here if is_ground else _ROAD))
        on_road[k] = 1.0 if here & _ROAD else 0.0
        on_walk[k] = 1.0 if here & _SIDEWALK else 0.0
    return int(found) + (EVERYWHERE if common == _ROAD else 0)


@device_function(divides_by_zero=True, in_lanes=True)
def _cover_evenly(count: int, light: Float64, is_road: bool, cover: Cover) -> None:
    """Write the light of road or terrain alone, as ``_pave`` does."""
    fine, coarse, shade, red, green, blue = cover
    up = single(light[at.SUN + 2])
    r, g = single(0.082 if is_road else 0.115), single(0.08282 if is_road else 0.150)
    b = single(0.0861 if is_road else 0.048)
    rough, rougher = single(0.22 if is_road else 0.5), single(0.75 if is_road else 0.87)
    sun_r, sky_r = r * single(light[at.SUNLIGHT]) * up, r * single(light[at.SKYLIGHT])
    sun_g, sky_g = g * single(light[at.SUNLIGHT + 1]) * up, g * single(light[at.SKYLIGHT + 1])
    sun_b, sky_b = b * single(light[at.SUNLIGHT + 2]) * up, b * single(light[at.SKYLIGHT + 2])
    for k in range(count):
        bright = 1.0 + rough * coarse[k] + rougher * fine[k]
        direct = shade[k] * bright
        ambient = 0.55 * bright + 0.45 * direct
        red[k] = sun_r * direct + sky_r * ambient
        green[k] = sun_g * direct + sky_g * ambient
        blue[k] = sun_b * direct + sky_b * ambient


@device_function(divides_by_zero=True, in_lanes=True)
def _pave(
    count: int, light: Float64, corner: tuple[float, float], spots: Triple, on_road: Float32, on_walk: Float32,
    cover: Cover,
) -> None:  # fmt: skip
    """Write the light of terrain, pavement and road by their shares."""
    xs, ys, along = spots
    fine, coarse, shade, red, green, blue = cover
    x, y, per_slab = single(corner[0]), single(corner[1]), 1.0 / 1.5
    up = single(light[at.SUN + 2])
    sun_r, sky_r = single(light[at.SUNLIGHT]) * up, single(light[at.SKYLIGHT])
    sun_g, sky_g = single(light[at.SUNLIGHT + 1]) * up, single(light[at.SKYLIGHT + 1])
    sun_b, sky_b = single(light[at.SUNLIGHT + 2]) * up, single(light[at.SKYLIGHT + 2])
    for k in range(count):
        rest, walk, road = 1.0 - on_road[k], on_walk[k], on_road[k]
        u, v = (xs[k] + x) * per_slab, (ys[k] + y) * per_slab
        is_joint = ((u - rounded_down(u) < 0.0167) | (v - rounded_down(v) < 0.0167)) & (along[k] < 0.3)
        slab = rest * walk * (0.72 if is_joint else 1.0) * (1.0 + 0.12 * coarse[k] + 0.25 * fine[k])
        grass = rest * (1.0 - walk) * (1.0 + 0.5 * coarse[k] + 0.87 * fine[k])
        asphalt = road * (1.0 + 0.22 * coarse[k] + 0.75 * fine[k])
        direct = shade[k]
        ambient = 0.55 + 0.45 * direct
        red[k] = (0.115 * grass + 0.34 * slab + 0.082 * asphalt) * (sun_r * direct + sky_r * ambient)
        green[k] = (0.150 * grass + 0.3298 * slab + 0.08282 * asphalt) * (sun_g * direct + sky_g * ambient)
        blue[k] = (0.048 * grass + 0.3128 * slab + 0.0861 * asphalt) * (sun_b * direct + sky_b * ambient)


@device_function(divides_by_zero=True, in_lanes=True)
def _paint_over(count: int, light: Float64, paint: Triple, on_road: Float32, cover: Cover) -> None:
    """Cover the ground with kerbs, whose gutters are dark, then with paint, which is worn."""
    whites, yellows, kerbs = paint
    fine, coarse, shade, red, green, blue = cover
    up = single(light[at.SUN + 2])
    sun_r, sky_r = single(light[at.SUNLIGHT]) * up, single(light[at.SKYLIGHT])
    sun_g, sky_g = single(light[at.SUNLIGHT + 1]) * up, single(light[at.SKYLIGHT + 1])
    sun_b, sky_b = single(light[at.SUNLIGHT + 2]) * up, single(light[at.SKYLIGHT + 2])
    for k in range(count):
        worn = 1.0 - 0.25 * larger(coarse[k] + 0.2, 0.0) - 0.5 * larger(fine[k], 0.0)
        white, yellow = whites[k] * worn, yellows[k] * worn
        bare = (1.0 - white) * (1.0 - yellow)
        kerb = kerbs[k] * bare
        white *= 1.0 - yellow
        rest = bare - kerb
        kerb *= 1.0 - 0.72 * on_road[k]
        direct = shade[k]
        ambient = 0.55 + 0.45 * direct
        red[k] = rest * red[k] + (0.74 * white + 0.68 * yellow + 0.46 * kerb) * (sun_r * direct + sky_r * ambient)
        green[k] = rest * green[k] + (0.74 * white + 0.43 * yellow + 0.45 * kerb) * (sun_g * direct + sky_g * ambient)
        blue[k] = rest * blue[k] + (0.72 * white + 0.05 * yellow + 0.42 * kerb) * (sun_b * direct + sky_b * ambient)


@device_function(divides_by_zero=True)
def _wet(light: Float64, frame: Float64, grain: UInt8, seen: Int32, shades: Float32) -> None:
    """Make the ground wet where it is seen."""
    for k in range(len(seen)):
        if seen[k] == codes.ON_GROUND:
            red, green, blue = wet_color(
                light, grain, frame[0] + shades[at.GROUND_X, k], frame[1] + shades[at.GROUND_Y, k],
                shades[at.RAY_Z, k] * shades[at.DISTANCE, k] / shades[at.FAR, k],
                shades[at.RED, k] * 1.0, shades[at.GREEN, k] * 1.0, shades[at.BLUE, k] * 1.0,
            )  # fmt: skip
            shades[at.RED, k], shades[at.GREEN, k], shades[at.BLUE, k] = red, green, blue


@device_function(divides_by_zero=True)
def wet_color(
    light: Float64, grain: UInt8, x: float, y: float, dz: float, red: float, green: float, blue: float
) -> tuple[float, float, float]:
    """Return the light of a wet road, which mirrors the sky, in a direction of view (unit vector)."""
    wet = light[at.WET] * (0.55 + 0.9 * (smooth_noise(grain[1], 1.3 * x, 1.3 * y) - 0.35))
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
