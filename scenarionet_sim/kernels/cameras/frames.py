"""Whole frames: the kernel of cameras."""

from __future__ import annotations

from scenarionet_data.arrays.compiled import kernel
from scenarionet_data.arrays.dtypes import Float64, Int32, Int64
from scenarionet_sim.kernels.cameras.instances import add_solids
from scenarionet_sim.kernels.cameras.labels import flow_row, label_row
from scenarionet_sim.kernels.cameras.layout import (
    BAND,
    FX,
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
from scenarionet_sim.kernels.cameras.rows import aim_rays, meet_ground
from scenarionet_sim.kernels.cameras.shading import cast_shadows, color_triangles, expose
from scenarionet_sim.kernels.cameras.sky import color_sky
from scenarionet_sim.kernels.cameras.triangles import list_band, trace_row
from scenarionet_sim.kernels.minmax import smaller


@kernel(allocates=False, nogil=True, divides_by_zero=True)
def draw_frames(
    first: int,
    end: int,
    order: Int64,
    who: Int32,
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
        who: (B, 3) slot, row of the own vehicle or -1, and how it is shown.
        poses: (B, NUM_POSE) cameras.
        lens: (NUM_LENS,).
        rays: (H, W, 3) directions right, down, ahead; unused by a pinhole.
        rings: (H,) descending elevations of a lidar's rings [rad]; unused by others.
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
    values = scratch.row
    for turn in range(first, end):
        frame, band = turn // len(order), order[turn % len(order)]
        slot, pose, light = who[frame, 0], poses[frame], look.lights[frame]
        if frame != drawn:
            count, num_shadows = add_solids(
                slot, who[frame, 1], who[frame, 2], pose, lens, rings, width, height, reach, are_boxes,
                is_colored, solids, ground, meshes, light, scratch, scratch.row[0],
            )  # fmt: skip
            drawn = frame
        top, bottom = band * BAND, smaller(band * BAND + BAND, height)
        num_active = list_band(top, bottom, count, scratch.instances, scratch.bounds, scratch.active)
        for node in range(scratch.sky.shape[1]):
            scratch.sky[0, node, 3] = 0.0
            scratch.sky[1, node, 3] = 0.0
        for row in range(top, bottom):
            trace_row(row, num_active, lens, rays, width, scratch)
            for start in range(0, width, TILE):
                num = smaller(TILE, width - start)
                near, seen = scratch.near[start : start + num], scratch.seen[start : start + num]
                aim_rays(row, start, num, pose, lens, rays, values)
                meet_ground(num, slot, pose, reach, ground, near, seen, values)
                label_row(frame, row, start, num, slot, ground, seen, scratch.labels, scratch.colors, values, pictures)
                if len(pictures.flow):
                    flow_row(
                        frame, row, start, num, slot, pose, lens, dt, solids.motion, seen, scratch.labels, values,
                        pictures.flow,
                    )  # fmt: skip
                if is_colored:
                    cast_shadows(row, start, num, num_shadows, light[SHADOW], values, scratch.shadows)
                    color_sky(row, start, num, size, pose, lens, rays, light, look.grain, seen, scratch.sky, values)
                    color_ground(
                        num,
                        slot,
                        1.0 / lens[FX],
                        ground,
                        light,
                        look.grain,
                        seen,
                        scratch.cells,
                        scratch.texels,
                        values,
                    )
                    color_triangles(
                        row, start, num, pose, lens, rays, scratch.edges, scratch.colors, scratch.labels, seen, values
                    )
                    expose(
                        row, start, num, size, light, look.tone, seen, scratch.texels, values,
                        pictures.rgb[frame, row, start : start + num],
                    )  # fmt: skip
