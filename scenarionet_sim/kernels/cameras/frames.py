"""Whole frames: the kernel of cameras."""

from __future__ import annotations

from scenarionet_data.arrays.compiled import device_function, kernel
from scenarionet_data.arrays.dtypes import Float64, Int32, Int64, UInt8
from scenarionet_sim.kernels.cameras.instances import add_solids
from scenarionet_sim.kernels.cameras.labels import label_pixels, write_flow
from scenarionet_sim.kernels.cameras.layout import (
    BAND,
    BLUE,
    FX,
    GREEN,
    GROUND_X,
    GROUND_Y,
    NOTHING,
    ON_GROUND,
    RED,
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
from scenarionet_sim.kernels.cameras.paving import color_ground
from scenarionet_sim.kernels.cameras.rows import aim_rays, meet_ground, place_points
from scenarionet_sim.kernels.cameras.shading import cast_shadows, color_triangles, expose, open_windows
from scenarionet_sim.kernels.cameras.sky import color_sky
from scenarionet_sim.kernels.cameras.triangles import trace_band
from scenarionet_sim.kernels.minmax import smaller


@kernel(allocates=False, nogil=True, divides_by_zero=True)
def draw_frames(
    first: int,
    end: int,
    order: Int64,
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
) -> None:
    """Draw bands of frames.

    Args:
        first, end: Bands of all frames, frame by frame.
        order: (number of bands of a frame,) the band to draw at each turn.
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
    """
    height, width = size
    are_boxes, reach, dt = options
    is_colored = len(pictures.rgb) > 0
    drawn, count, num_shadows = -1, 0, 0
    for turn in range(first, end):
        frame, band = turn // len(order), order[turn % len(order)]
        slot, pose = owners[frame, 0], poses[frame]
        if frame != drawn:
            count, num_shadows = add_solids(
                slot, owners[frame, 1], owners[frame, 2], pose, lens, rings, width, height, reach, are_boxes,
                is_colored, solids, ground, meshes, look.lights[frame], scratch, scratch.exact[0],
            )  # fmt: skip
            drawn = frame
        top, bottom = band * BAND, smaller(band * BAND + BAND, height)
        trace_band(top, bottom, count, lens, rays, width, scratch)
        for node in range(scratch.sky.shape[1]):
            scratch.sky[0, node, 3] = 0.0
            scratch.sky[1, node, 3] = 0.0
        for start in range(0, (bottom - top) * width, TILE):
            num, place = smaller(TILE, (bottom - top) * width - start), top * width + start
            near, seen = scratch.near[start : start + num], scratch.seen[start : start + num]
            k = 0
            while k < num:
                row, column = (place + k) // width, (place + k) % width
                after = smaller(k + width - column, num)
                aim_rays(row, column, k, after, pose, lens, rays, scratch.exact)
                k = after
            meet_ground(num, slot, pose, reach, ground, near, seen, scratch.exact)
            label_pixels(
                frame, place, slot, pose, ground, seen, scratch.labels, scratch.colors, scratch.exact, pictures
            )
            if len(pictures.flow):
                write_flow(
                    frame, place, width, slot, pose, lens, dt, solids.motion, seen, scratch.labels, scratch.exact,
                    pictures.flow,
                )  # fmt: skip
            if is_colored:
                color_tile(
                    place, slot, pose, size, lens, rays, num_shadows, ground, look.lights[frame], look.grain, seen,
                    scratch,
                )  # fmt: skip
                expose(
                    place, size, look.lights[frame], look.tone, seen, scratch.texels, scratch.shades,
                    pictures.rgb[frame, place : place + num],
                )  # fmt: skip


@device_function(divides_by_zero=True, nogil=True)
def color_tile(
    place: int, slot: int, pose: Float64, size: tuple[int, int], lens: Float64, rays: Float64, num_shadows: int,
    ground: Ground, light: Float64, grain: UInt8, seen: Int32, scratch: FrameMemory,
) -> None:  # fmt: skip
    """Write the light of the pixels of a tile, from number ``place`` of the picture on."""
    shades, exact, count, width, grid = scratch.shades, scratch.exact, len(seen), size[1], ground.frame[slot]
    place_points(count, pose, grid, exact, shades)
    is_ground = is_triangle = is_sky = False
    for k in range(count):
        is_ground |= seen[k] == ON_GROUND
        is_triangle |= seen[k] >= 0
        is_sky |= seen[k] == NOTHING
    if is_ground:
        shade = shades[SHADE]
        for k in range(count):
            shade[k] = 1.0
        if num_shadows:
            k = 0
            while k < count:
                row, column = (place + k) // width, (place + k) % width
                end = smaller(k + width - column, count)
                cast_shadows(
                    row, column, num_shadows, light[SHADOW], grid, scratch.shadows, seen[k:end],
                    shades[GROUND_X, k:end], shades[GROUND_Y, k:end], shade[k:end],
                )  # fmt: skip
                k = end
        color_ground(slot, 1.0 / lens[FX], ground, light, grain, seen, scratch.cells, scratch.texels, exact, shades)
    if is_triangle or is_sky:
        k = 0
        while k < count:
            row, column = (place + k) // width, (place + k) % width
            end = smaller(k + width - column, count)
            if is_triangle:
                color_triangles(
                    row, column, scratch.colors, seen[k:end], shades[RED, k:end], shades[GREEN, k:end],
                    shades[BLUE, k:end],
                )  # fmt: skip
            if is_sky:
                color_sky(row, column, k, end, size, pose, lens, rays, light, grain, seen, scratch.sky, shades)
            k = end
    if is_triangle:
        open_windows(pose, lens, grid, scratch.colors, scratch.labels, seen, exact, shades)
