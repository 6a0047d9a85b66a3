"""What one thread of a graphics card does for a pixel, as the processor for a tile, or for a node of the sky."""

from __future__ import annotations

from scenarionet_data.arrays.dtypes import Float32
from scenarionet_data.compiled.decorators import device_function
from scenarionet_sim.arrays.minmax import smaller
from scenarionet_sim.cameras.channels import write_channels
from scenarionet_sim.cameras.cuda.items import (
    BOTTOM,
    END,
    FIRST,
    IS_OUTLINE,
    LEFT,
    NUM_INSTANCES,
    NUM_SHADOWS,
    RIGHT,
    TOP,
    Items,
    view_of,
)
from scenarionet_sim.cameras.draw import codes
from scenarionet_sim.cameras.draw import columns as at
from scenarionet_sim.cameras.draw.frames import color_tile
from scenarionet_sim.cameras.draw.outlines import span_of_outline
from scenarionet_sim.cameras.draw.rows import look_along
from scenarionet_sim.cameras.draw.shading import expose
from scenarionet_sim.cameras.draw.single_precision import single
from scenarionet_sim.cameras.draw.sky import IS_LIT, between_nodes, light_nodes
from scenarionet_sim.cameras.draw.structures import (
    BAND,
    SKY_STEP,
    FrameView,
    Look,
    Pictures,
    SceneArrays,
    Shots,
    Tile,
    Triangles,
)
from scenarionet_sim.cameras.draw.triangles import inverse_distance, span_of


@device_function(allocates=True, divides_by_zero=True)
def light_sky(frame: int, node_row: int, node: int, shots: Shots, look: Look, nodes: Float32) -> None:
    """Write the light of the sky at a node of ``nodes`` (B, bands + 1, 3, N)."""
    row = smaller(node_row * BAND, shots.height - 1)
    light_nodes(row, node, node + 1, view_of(frame, shots, look), look.grain, nodes[frame, node_row])


@device_function(divides_by_zero=True)
def stretch_sky(frame: int, node_row: int, column: int, nodes: Float32, sky: Float32) -> None:
    """Write the light of the sky in a column of ``sky`` (B, bands + 1, 4, W) between two nodes."""
    node, lane = column // SKY_STEP, column % SKY_STEP
    for channel in range(3):
        sky[frame, node_row, channel, column] = between_nodes(nodes[frame, node_row], channel, node, lane)
    sky[frame, node_row, IS_LIT, column] = 1.0


@device_function(divides_by_zero=True)
def trace_pixel(
    frame: int, row: int, column: int, view: FrameView, items: Items, triangles: Triangles
) -> tuple[float, int]:
    """Return the inverse distance of the nearest triangle along the ray of a pixel, or 0, and its number, or -1."""
    near, seen, first = 0.0, -1, items.first[frame]
    is_pinhole = view.lens[at.KIND] == codes.PINHOLE
    for place in range(items.counts[frame, NUM_INSTANCES]):
        instance = items.instances[frame, place]
        if not (instance[TOP] <= row < instance[BOTTOM] and instance[LEFT] <= column < instance[RIGHT]):
            continue
        for triangle in range(first + instance[FIRST], first + instance[END]):
            bounds = triangles.bounds[triangle]
            if not (bounds[1] <= row < bounds[3] and bounds[0] <= column < bounds[2]):
                continue
            inverse = -1.0
            if is_pinhole:
                spans = triangles.spans[triangle]
                is_outline = instance[IS_OUTLINE] == 1
                left, right = span_of_outline(bounds, spans, row) if is_outline else span_of(bounds, spans, row)
                if left <= column < right:
                    inverse = spans[9] + spans[11] * row + spans[10] * left + spans[10] * (column - left)
            else:
                ray = view.rays[row, column]
                inverse = inverse_distance(triangles.edges[triangle], ray[0], ray[1], ray[2])
            inverse = single(inverse) * 1.0
            if inverse > near:
                near, seen = inverse, int(triangle)
    return near, seen


@device_function(allocates=True, divides_by_zero=True)
def draw_pixel(
    frame: int, number: int, shots: Shots, scene: SceneArrays, items: Items, triangles: Triangles, tile: Tile,
    pictures: Pictures,
) -> None:  # fmt: skip
    """Write all channels of a pixel, by its number in the picture; ``tile`` has memory for one."""
    view, row, column = view_of(frame, shots, scene.look), number // shots.width, number % shots.width
    tile.near[0], tile.seen[0] = trace_pixel(frame, row, column, view, items, triangles)
    sees = look_along(number, view, scene.ground, tile)
    write_channels(frame, number, view, scene, triangles, tile, pictures)
    if view.is_colored:
        shadows = items.shadows[frame, : items.counts[frame, NUM_SHADOWS]]
        color_tile(number, sees, view, scene.ground, scene.look.grain, triangles, shadows, tile)
        picture = pictures[0][frame, 3 * number : 3 * number + 3]
        expose(number, view, scene.look.tone, tile.seen, tile.shades, picture)
