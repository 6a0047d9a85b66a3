"""Whole frames: the kernel of cameras."""

from __future__ import annotations

from scenarionet_data.arrays.dtypes import Float64, Int32, UInt8
from scenarionet_data.compiled.decorators import device_function, kernel
from scenarionet_sim.arrays.minmax import smaller
from scenarionet_sim.cameras.draw.instances import add_solids
from scenarionet_sim.cameras.draw.labels import label_pixels, write_flow
from scenarionet_sim.cameras.draw.layout import (
    BAND,
    BANDS,
    FX,
    GROUND_X,
    GROUND_Y,
    SEES_GROUND,
    SEES_SKY,
    SEES_TRIANGLE,
    SHADE,
    SHADOW,
    TILE,
    FrameMemory,
    Ground,
    Look,
    Meshes,
    Pictures,
    Solids,
)
from scenarionet_sim.cameras.draw.paving import color_ground
from scenarionet_sim.cameras.draw.rows import look_along
from scenarionet_sim.cameras.draw.shading import cast_shadows, color_triangles, expose
from scenarionet_sim.cameras.draw.sky import carry_sky, color_sky
from scenarionet_sim.cameras.draw.triangles import trace_band


@kernel(allocates=False, nogil=True, divides_by_zero=True, is_wide=True)
def draw_frames(
    first: int,
    end: int,
    owners: Int32,
    poses: Float64,
    lens: Float64,
    rays: Float64,
    rings: Float64,
    size: tuple[int, int],
    options: tuple[bool, float, float],
    solids: Solids,
    ground: Ground,
    meshes: Meshes,
    look: Look,
    scratch: FrameMemory,
    pictures: Pictures,
) -> int:
    """Draw parts of frames, ``BANDS`` bands each.

    Args:
        first, end: Range of the parts of all frames, frame by frame.
        owners: (B, 3) slot, row of the own vehicle or -1, and how it is shown.
        poses: (B, NUM_POSE) cameras.
        lens: (NUM_LENS,).
        rays: (H, W, 3) directions right, down, ahead; unused by a pinhole.
        rings: (H,) descending slopes of a lidar's rings; unused by others.
        size: Height and width [pixels].
        options: Whether objects are boxes, reach [m], time of the flow [s].
        solids, ground, meshes, look: The scenes.
        scratch: Memory of the calling thread.
        pictures: Outputs.

    Returns:
        The last part.
    """
    height, width = size
    are_boxes, reach, dt = options
    is_colored = len(pictures.rgb) > 0
    drawn, count, num_shadows, shown, above = -1, 0, 0, -1, -1
    parts = (height + BAND * BANDS - 1) // (BAND * BANDS)
    for part in range(first, end):
        frame = part // parts
        slot, pose = owners[frame, 0], poses[frame]
        if frame != drawn:
            count, num_shadows = add_solids(
                slot, owners[frame, 1], owners[frame, 2], pose, lens, rings, width, height, reach, are_boxes,
                is_colored, len(pictures.normals) > 0, solids, ground, meshes, look.lights[frame], scratch,
                scratch.box,
            )  # fmt: skip
            drawn = frame
        for band in range(part % parts * BANDS, smaller(part % parts * BANDS + BANDS, (height + BAND - 1) // BAND)):
            top, bottom = band * BAND, smaller(band * BAND + BAND, height)
            trace_band(top, bottom, count, lens, rays, width, scratch)
            carry_sky(frame == shown and band == above + 1, width, scratch.sky)
            shown, above = frame, band
            num_pixels = (bottom - top) * width
            for start in range(0, num_pixels, TILE):
                num, place = smaller(TILE, num_pixels - start), top * width + start
                near, seen = scratch.near[start : start + num], scratch.seen[start : start + num]
                kinds = look_along(place, num, slot, pose, lens, rays, width, reach, ground, near, seen, scratch.shades)
                label_pixels(
                    frame, place, slot, pose, ground, seen, scratch.labels, scratch.colors, scratch.shades, pictures
                )
                if len(pictures.flow):
                    write_flow(
                        frame, place, width, slot, pose, lens, dt, solids.motion, seen, scratch.labels, scratch.shades,
                        pictures.flow,
                    )  # fmt: skip
                if is_colored:
                    color_tile(
                        place, slot, pose, size, lens, rays, num_shadows, kinds, ground, look.lights[frame], look.grain,
                        seen, scratch,
                    )  # fmt: skip
                    expose(
                        place, size, look.lights[frame], look.tone, seen, scratch.shades,
                        pictures.rgb[frame, 3 * place : 3 * (place + num)],
                    )  # fmt: skip
    return end - 1


@device_function(forceinline=True, divides_by_zero=True, nogil=True)
def color_tile(
    place: int, slot: int, pose: Float64, size: tuple[int, int], lens: Float64, rays: Float64, num_shadows: int,
    kinds: int, ground: Ground, light: Float64, grain: UInt8, seen: Int32, scratch: FrameMemory,
) -> None:  # fmt: skip
    """Write the light of the pixels of a tile, from number ``place`` of the picture on, which see some kinds."""
    shades, count, width, grid = scratch.shades, len(seen), size[1], ground.frame[slot]
    if kinds & SEES_GROUND:
        shade = shades[SHADE]
        for k in range(count):
            shade[k] = 1.0
        if num_shadows:
            first, row, column = 0, place // width, place % width
            while first < count:
                end = smaller(first + width - column, count)
                cast_shadows(
                    row, column, num_shadows, light[SHADOW], grid, scratch.shadows, seen[first:end],
                    shades[GROUND_X, first:end], shades[GROUND_Y, first:end], shade[first:end],
                )  # fmt: skip
                first, row, column = end, row + 1, 0
        color_ground(slot, 1.0 / lens[FX], ground, light, grain, seen, scratch.cells, scratch.texels, shades)
    if kinds & (SEES_TRIANGLE | SEES_SKY):
        first, row, column = 0, place // width, place % width
        while first < count:
            end = smaller(first + width - column, count)
            if kinds & SEES_TRIANGLE:
                color_triangles(
                    row, column - first, first, end, pose, lens, grid, scratch.colors, scratch.labels, seen, shades
                )
            if kinds & SEES_SKY:
                color_sky(
                    row, column, first, end, size, pose, lens, rays, light, grain, seen, scratch.nodes, scratch.sky,
                    shades,
                )  # fmt: skip
            first, row, column = end, row + 1, 0
