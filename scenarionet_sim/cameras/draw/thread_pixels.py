"""Pixels of frames drawn by thousands of threads: what one thread of a graphics card does, see ``thread_items``."""

from __future__ import annotations

from scenarionet_data.arrays.dtypes import Float32, Float64
from scenarionet_data.compiled.decorators import device_function
from scenarionet_sim.arrays.minmax import smaller
from scenarionet_sim.cameras.draw.frames import color_tile
from scenarionet_sim.cameras.draw.labels import label_pixels, write_flow
from scenarionet_sim.cameras.draw.layout import (
    BAND,
    KIND,
    PINHOLE,
    SKY_STEP,
    FrameMemory,
    Ground,
    Look,
    Pictures,
)
from scenarionet_sim.cameras.draw.outlines import span_of_outline
from scenarionet_sim.cameras.draw.rows import look_along
from scenarionet_sim.cameras.draw.shading import expose
from scenarionet_sim.cameras.draw.singles import single
from scenarionet_sim.cameras.draw.sky import IS_LIT, between_nodes, light_nodes
from scenarionet_sim.cameras.draw.thread_layout import (
    BOTTOM,
    END,
    FIRST,
    IS_OUTLINE,
    LEFT,
    NUM_INSTANCES,
    NUM_SHADOWS,
    RIGHT,
    TOP,
    DrawingOptions,
    Items,
    PixelMemory,
    Shots,
    Triangles,
)
from scenarionet_sim.cameras.draw.triangles import inverse_distance, span_of


@device_function(divides_by_zero=True)
def light_sky(
    frame: int, node_row: int, node: int, size: tuple[int, int], shots: Shots, look: Look, nodes: Float32
) -> None:
    """Write the light of the sky at a node of ``nodes`` (B, bands + 1, 3, N)."""
    light_nodes(
        smaller(node_row * BAND, size[0] - 1), node, node + 1, size[1], shots.poses[frame], shots.lens, shots.rays,
        look.lights[frame], look.grain, nodes[frame, node_row],
    )  # fmt: skip


@device_function(divides_by_zero=True)
def stretch_sky(frame: int, node_row: int, column: int, nodes: Float32, sky: Float32) -> None:
    """Write the light of the sky in a column of ``sky`` (B, bands + 1, 4, W) between two nodes."""
    node, lane = column // SKY_STEP, column % SKY_STEP
    for channel in range(3):
        sky[frame, node_row, channel, column] = between_nodes(nodes[frame, node_row], channel, node, lane)
    sky[frame, node_row, IS_LIT, column] = 1.0


@device_function(divides_by_zero=True)
def trace_pixel(
    frame: int, row: int, column: int, shots: Shots, items: Items, triangles: Triangles
) -> tuple[float, int]:
    """Return the inverse distance of the nearest triangle along the ray of a pixel, or 0, and its number, or -1."""
    near, seen, first = 0.0, -1, triangles.first[frame, 0]
    is_pinhole = shots.lens[KIND] == PINHOLE
    for place in range(items.counts[frame, NUM_INSTANCES]):
        instance = items.instances[frame, place]
        if not (instance[TOP] <= row < instance[BOTTOM] and instance[LEFT] <= column < instance[RIGHT]):
            continue
        is_outline = items.kinds[frame, items.drawn[frame, place], IS_OUTLINE]
        for triangle in range(first + instance[FIRST], first + instance[END]):
            bounds = triangles.bounds[triangle]
            if not (bounds[1] <= row < bounds[3] and bounds[0] <= column < bounds[2]):
                continue
            inverse = -1.0
            if is_pinhole:
                spans = triangles.spans[triangle]
                left, right = span_of_outline(bounds, spans, row) if is_outline else span_of(bounds, spans, row)
                if left <= column < right:
                    inverse = spans[9] + spans[11] * row + spans[10] * left + spans[10] * (column - left)
            else:
                ray = shots.rays[row, column]
                inverse = inverse_distance(triangles.edges[triangle], ray[0], ray[1], ray[2])
            inverse = single(inverse) * 1.0
            if inverse > near:
                near, seen = inverse, int(triangle)
    return near, seen


@device_function(divides_by_zero=True)
def draw_pixel(
    frame: int, row: int, column: int, size: tuple[int, int], options: DrawingOptions, shots: Shots, motion: Float64,
    ground: Ground, look: Look, items: Items, triangles: Triangles, sky: Float32, memory: PixelMemory,
    pictures: Pictures,
) -> None:  # fmt: skip
    """Write all channels of a pixel.

    Args:
        frame, row, column: The pixel.
        size, options, shots, motion, ground, look, items, triangles, sky: The scenes, see above.
        memory: Of the thread.
        pictures: Outputs.
    """
    _, is_colored, reach, dt = options
    slot, pose, light = shots.owners[frame, 0], shots.poses[frame], look.lights[frame]
    lens, rays = shots.lens, shots.rays
    seen, number, band = memory.seen, row * size[1] + column, row // BAND
    memory.near[0], seen[0] = trace_pixel(frame, row, column, shots, items, triangles)
    kinds = look_along(number, 1, slot, pose, lens, rays, size[1], reach, ground, memory.near, seen, memory.shades)
    label_pixels(frame, number, slot, pose, ground, seen, triangles.labels, triangles.colors, memory.shades, pictures)
    if len(pictures.flow):
        write_flow(
            frame, number, size[1], slot, pose, lens, dt, motion, seen, triangles.labels, memory.shades, pictures.flow
        )
    if is_colored:
        scratch = FrameMemory(
            triangles.vertices, triangles.lights, triangles.edges, triangles.spans, triangles.colors, triangles.labels,
            triangles.bounds, items.instances[frame], items.shadows[frame], memory.texels, memory.near, seen,
            memory.shades, memory.cells, memory.texels, items.boxes[frame, 0], memory.near, items.drawn[frame],
            items.drawn[frame], memory.shades, sky[frame, band : band + 2],
        )  # fmt: skip
        num_shadows = items.counts[frame, NUM_SHADOWS]
        color_tile(number, slot, pose, size, lens, rays, num_shadows, kinds, ground, light, look.grain, seen, scratch)
        expose(
            number, size, light, look.tone, seen, memory.shades, pictures.rgb[frame, 3 * number : 3 * number + 3],
        )  # fmt: skip
