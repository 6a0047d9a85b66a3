"""Whole frames: the kernel of cameras."""

from __future__ import annotations

from scenarionet_data.arrays.dtypes import Float64, Int64, UInt8
from scenarionet_data.compiled.decorators import device_function, kernel
from scenarionet_sim.arrays.minmax import smaller
from scenarionet_sim.cameras.channels import write_channels
from scenarionet_sim.cameras.draw import codes
from scenarionet_sim.cameras.draw import columns as at
from scenarionet_sim.cameras.draw.ground_colors import color_ground
from scenarionet_sim.cameras.draw.instances import add_solids
from scenarionet_sim.cameras.draw.rows import look_along
from scenarionet_sim.cameras.draw.shading import cast_shadows, color_triangles, expose
from scenarionet_sim.cameras.draw.sky import carry_sky, color_sky
from scenarionet_sim.cameras.draw.structures import (
    BAND,
    BANDS,
    TILE,
    FrameMemory,
    FrameView,
    Ground,
    Pictures,
    SceneArrays,
    Shots,
    Tile,
    Triangles,
)
from scenarionet_sim.cameras.draw.triangles import trace_band
from scenarionet_sim.threads.sharing import take


@kernel(allocates=False, nogil=True, divides_by_zero=True, is_wide=True)
def draw_frames(
    own: int, ranges: Int64, shots: Shots, scene: SceneArrays, scratch: FrameMemory, pictures: Pictures
) -> None:
    """Draw parts of frames, ``BANDS`` bands each.

    Args:
        own, ranges: Number of the thread, and parts of all frames, frame by frame, see ``threads.sharing``.
        shots, scene: The cameras and what they see.
        scratch: Memory of the calling thread.
        pictures: Outputs.
    """
    height, width, memory = shots.height, shots.width, scratch.band
    drawn, count, num_shadows, shown, above = -1, 0, 0, -1, -1
    parts = (height + BAND * BANDS - 1) // (BAND * BANDS)
    part = take(ranges, own)
    while part >= 0:
        frame = part // parts
        view = FrameView(
            shots.owners[frame, 0], shots.owners[frame, 1], shots.owners[frame, 2], shots.poses[frame],
            scene.look.lights[frame], shots.lens, shots.rays, shots.rings, width, height, shots.reach, shots.flow_time,
            shots.are_boxes, shots.is_colored,
        )  # fmt: skip
        if frame != drawn:
            count, num_shadows = add_solids(view, scene.solids, scene.ground, scene.meshes, scratch)
            drawn = frame
        for band in range(part % parts * BANDS, smaller(part % parts * BANDS + BANDS, (height + BAND - 1) // BAND)):
            top, bottom = band * BAND, smaller(band * BAND + BAND, height)
            trace_band(top, bottom, count, view, scratch)
            carry_sky(frame == shown and band == above + 1, width, memory.sky)
            shown, above = frame, band
            num_pixels = (bottom - top) * width
            for start in range(0, num_pixels, TILE):
                stop, place = smaller(start + TILE, num_pixels), top * width + start
                tile = Tile(
                    memory.near[start:stop], memory.seen[start:stop], memory.shades, memory.cells, memory.texels,
                    memory.nodes, memory.sky,
                )  # fmt: skip
                sees = look_along(place, view, scene.ground, tile)
                write_channels(frame, place, view, scene, scratch.triangles, tile, pictures)
                if shots.is_colored:
                    shadows = scratch.shadows[:num_shadows]
                    color_tile(place, sees, view, scene.ground, scene.look.grain, scratch.triangles, shadows, tile)
                    picture = pictures[0][frame, 3 * place : 3 * (place + stop - start)]
                    expose(place, view, scene.look.tone, tile.seen, tile.shades, picture)
        part = take(ranges, own)


@device_function(forceinline=True, divides_by_zero=True, nogil=True)
def color_tile(
    place: int,
    sees: int,
    view: FrameView,
    ground: Ground,
    grain: UInt8,
    triangles: Triangles,
    shadows: Float64,
    tile: Tile,
) -> None:
    """Write the light of the pixels of a tile, from number ``place`` of the picture on, which see some kinds."""
    shades, count, width, grid = tile.shades, len(tile.seen), view.width, ground.frame[view.slot]
    if sees & codes.SEES_GROUND:
        shade, night = shades[at.SHADE], view.light[at.NIGHT]
        for k in range(count):
            shade[k] = 1.0 - 0.98 * night
        if len(shadows):
            first, row, column = 0, place // width, place % width
            while first < count:
                end = smaller(first + width - column, count)
                spots = shades[at.GROUND_X, first:end], shades[at.GROUND_Y, first:end], shade[first:end]
                if night > 0.0:
                    cast_shadows(row, column, 0.0, grid, shadows, tile.seen[first:end], spots)
                cast_shadows(row, column, view.light[at.SHADOW], grid, shadows, tile.seen[first:end], spots)
                first, row, column = end, row + 1, 0
        color_ground(view, ground, grain, tile)
    if sees & (codes.SEES_TRIANGLE | codes.SEES_SKY):
        first, row, column = 0, place // width, place % width
        while first < count:
            pixels = first, smaller(first + width - column, count)
            if sees & codes.SEES_TRIANGLE:
                color_triangles(row, column - first, pixels, view, triangles, tile.seen, shades)
            if sees & codes.SEES_SKY:
                color_sky(row, column, pixels, view, grain, tile)
            first, row, column = pixels[1], row + 1, 0
