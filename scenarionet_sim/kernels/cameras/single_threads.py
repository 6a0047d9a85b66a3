"""Frames drawn by thousands of threads: what one thread of a graphics card does in each step of drawing.

A pixel is drawn by the functions that the processor's kernel calls for tiles, here with tiles of one pixel. The steps
of a call, each over all frames:

1. ``find_item`` for every object and fixture: whether it is in view, and its shadow.
2. ``list_items`` for every frame: those in view, and the places of their vertices and triangles.
3. ``place_part`` and ``set_up_part`` for parts of every instance: its vertices, then its triangles; then
   ``bound_instance``.
4. ``light_sky`` for every node of the sky.
5. ``draw_pixel`` for every pixel.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from scenarionet_data.arrays.compiled import device_function
from scenarionet_data.arrays.dtypes import Float32, Float64, Int32
from scenarionet_sim.kernels.cameras.frames import color_tile
from scenarionet_sim.kernels.cameras.instances import (
    LEAST,
    LEAST_FIXED,
    appearance_of,
    casts_shadow,
    write_box,
)
from scenarionet_sim.kernels.cameras.labels import label_pixels, write_flow
from scenarionet_sim.kernels.cameras.layout import (
    BAND,
    HIDDEN,
    INSTANCE_ROW,
    KIND,
    MATERIAL,
    PINHOLE,
    SEMANTIC,
    SHADOW,
    SKY_STEP,
    FrameMemory,
    Ground,
    Look,
    Meshes,
    Pictures,
    Solids,
)
from scenarionet_sim.kernels.cameras.lighting import light_vertices
from scenarionet_sim.kernels.cameras.placement import SMALL, color_triangle, mesh_for, screen_radius, write_normal
from scenarionet_sim.kernels.cameras.rows import aim_rays, meet_ground
from scenarionet_sim.kernels.cameras.shading import expose
from scenarionet_sim.kernels.cameras.shadows import add_shadow
from scenarionet_sim.kernels.cameras.sky import light_node
from scenarionet_sim.kernels.cameras.triangles import add_triangle, inverse_distance, span_of
from scenarionet_sim.kernels.cameras.vertices import place_vertex
from scenarionet_sim.kernels.minmax import larger, smaller

SPIN, STEER, NUM_BOX = 7, 8, 9
"""Columns of ``Items.boxes`` behind x, y, z, heading, length, width, height; and their number."""

MESH, ITEM_CLASS, PAINT, GLOW, HAS_SHADOW, IS_SMALL, NUM_ITEM = range(7)
"""Columns of ``Items.kinds``: mesh to draw or -1, class, paint, shining material or -1, whether there is a shadow, and
whether triangles have one colour; and their number."""

FIRST, END, FIRST_VERTEX, LEFT, TOP, RIGHT, BOTTOM, NUM_INSTANCE = range(8)
"""Columns of ``Items.instances``: triangles and first vertex, counted from those of the frame, bounds on the screen
[pixels]; and their number."""

NUM_INSTANCES, NUM_SHADOWS, NUM_TRIANGLES, NUM_VERTICES, NUM_COUNTS = range(5)
"""Columns of ``Items.counts``, and their number."""

DrawingOptions = tuple[bool, bool, float, float]
"""Whether objects are boxes, whether colours are wanted, reach [m], time of the flow [s]."""


class Shots(NamedTuple):
    """The cameras of a call.

    Attributes:
        who: (B, 3) slot, row of the own vehicle or -1, and how it is shown.
        poses: (B, NUM_POSE) cameras.
        lens: (NUM_LENS,).
        rays: (H, W, 3) directions right, down, ahead; unused by a pinhole.
        rings: (0,) unused: lidars are drawn by the processor.
    """

    who: Int32
    poses: Float64
    lens: Float64
    rays: Float64
    rings: Float64


class Items(NamedTuple):
    """Objects and fixtures of B frames, N each.

    Attributes:
        boxes: (B, N, NUM_BOX), see above.
        kinds: (B, N, NUM_ITEM), see above.
        shadows: (B, N, 12) see ``FrameMemory.shadows``; after ``list_items`` the first ones are those in view.
        drawn: (B, N) items in view.
        instances: (B, N, NUM_INSTANCE) see above, of the items in ``drawn``.
        counts: (B, NUM_COUNTS), see above.
    """

    boxes: Float64
    kinds: Int32
    shadows: Float64
    drawn: Int32
    instances: Int32
    counts: Int32


class Triangles(NamedTuple):
    """Triangles of all frames, see ``FrameMemory``; those out of view have empty bounds.

    Attributes:
        first: (B, 2) first triangle and first vertex of each frame.
        vertices, lights: (NUM_VERTEX, V), (NUM_LIGHTS, V).
        edges, spans, colors, labels, bounds: (T, 12), (T, 12), (T, 12), (T, 3), (T, 4).
    """

    first: Int32
    vertices: Float64
    lights: Float32
    edges: Float64
    spans: Float64
    colors: Float32
    labels: Int32
    bounds: Int32


class PixelMemory(NamedTuple):
    """Memory of a thread, see ``FrameMemory``, for tiles of one pixel.

    Attributes:
        near, seen, cells, texels: (1,).
        exact, shades: (NUM_EXACT, 1), (NUM_SHADES, 1).
    """

    near: Float64
    seen: Int32
    exact: Float64
    shades: Float32
    cells: Int32
    texels: Int32


@device_function(divides_by_zero=True)
def find_item(
    frame: int, item: int, size: tuple[int, int], options: DrawingOptions, shots: Shots, solids: Solids, ground: Ground,
    meshes: Meshes, look: Look, items: Items,
) -> None:  # fmt: skip
    """Write whether and how an object or a fixture is in view, and its shadow."""
    height, width = size
    are_boxes, is_colored, reach, _ = options
    slot, own, own_view = shots.who[frame, 0], shots.who[frame, 1], shots.who[frame, 2]
    pose, light = shots.poses[frame], look.lights[frame]
    box, kind = items.boxes[frame, item], items.kinds[frame, item]
    kind[MESH], kind[HAS_SHADOW] = -1, 0
    rows = solids.motion.shape[1]
    if item >= rows + solids.fixed_range[slot, 1] - solids.fixed_range[slot, 0]:
        return
    if not write_box(item, slot, pose, reach, solids, ground, box):
        return
    is_object = item < rows
    has_shadows = is_colored and light[SHADOW] > 0.0 and shots.lens[KIND] == PINHOLE
    if has_shadows and casts_shadow(is_object, box, pose):
        own_shadow = items.shadows[frame, item : item + 1]
        kind[HAS_SHADOW] = add_shadow(box, pose, shots.lens, width, height, light, own_shadow, 0)
    if item == own and own_view == HIDDEN:
        return
    radius = screen_radius(box, pose, shots.lens, width, height, reach)
    if radius < (LEAST if is_object else LEAST_FIXED):
        return
    mesh, semantic, paint, glow, spin, steer = appearance_of(
        item, slot, own, own_view, are_boxes, is_colored, solids, box
    )
    kind[MESH], kind[ITEM_CLASS], kind[PAINT], kind[GLOW] = mesh_for(meshes, mesh, radius), semantic, paint, glow
    kind[IS_SMALL] = 1 if radius < SMALL else 0
    box[SPIN], box[STEER] = spin, steer


@device_function(divides_by_zero=True)
def list_items(frame: int, meshes: Meshes, items: Items) -> None:
    """List the instances in view of a frame and its shadows, count its triangles and vertices."""
    count, num_triangles, num_vertices, num_shadows = 0, 0, 0, 0
    for item in range(items.kinds.shape[1]):
        kind = items.kinds[frame, item]
        if kind[HAS_SHADOW]:
            for column in range(12):
                items.shadows[frame, num_shadows, column] = items.shadows[frame, item, column]
            num_shadows += 1
        if kind[MESH] >= 0:
            ranges, instance = meshes.ranges[kind[MESH]], items.instances[frame, count]
            items.drawn[frame, count] = item
            instance[FIRST], instance[FIRST_VERTEX] = num_triangles, num_vertices
            num_vertices += ranges[1] - ranges[0]
            num_triangles += ranges[3] - ranges[2]
            instance[END] = num_triangles
            count += 1
    items.counts[frame, NUM_INSTANCES], items.counts[frame, NUM_SHADOWS] = count, num_shadows
    items.counts[frame, NUM_TRIANGLES], items.counts[frame, NUM_VERTICES] = num_triangles, num_vertices


@device_function(divides_by_zero=True)
def place_part(
    frame: int, place: int, part: int, num_parts: int, is_colored: bool, shots: Shots, meshes: Meshes, look: Look,
    items: Items, triangles: Triangles,
) -> None:  # fmt: skip
    """Write every ``num_parts``-th vertex of an instance from number ``part`` on, and the light on it."""
    item = items.drawn[frame, place]
    box, mesh = items.boxes[frame, item], int(items.kinds[frame, item, MESH])
    turn, ranges = (math.cos(box[3]), math.sin(box[3])), meshes.ranges[mesh]
    first = triangles.first[frame, 1] + items.instances[frame, place, FIRST_VERTEX]
    for number in range(part, ranges[1] - ranges[0], num_parts):
        vertex = triangles.vertices[:, first + number : first + number + 1]
        place_vertex(
            meshes,
            mesh,
            ranges[0] + number,
            0,
            box,
            turn,
            box[SPIN],
            box[STEER],
            shots.poses[frame],
            shots.lens,
            vertex,
        )
        if is_colored:
            lights = triangles.lights[:, first + number : first + number + 1]
            light_vertices(look.lights[frame], 1, ranges[6] > 0, vertex, lights)


@device_function(divides_by_zero=True)
def set_up_part(
    frame: int, place: int, part: int, num_parts: int, size: tuple[int, int], is_colored: bool, num_objects: int,
    shots: Shots, meshes: Meshes, look: Look, items: Items, triangles: Triangles,
) -> None:  # fmt: skip
    """Write every ``num_parts``-th triangle of an instance whose vertices are placed, from number ``part`` on."""
    item, instance = items.drawn[frame, place], items.instances[frame, place]
    kind = items.kinds[frame, item]
    ranges, is_flat = meshes.ranges[kind[MESH]], kind[IS_SMALL] == 1
    first, begin = triangles.first[frame, 0] + instance[FIRST], triangles.first[frame, 1] + instance[FIRST_VERTEX]
    vertices = triangles.vertices[:, begin : begin + ranges[1] - ranges[0]]
    lights = triangles.lights[:, begin : begin + ranges[1] - ranges[0]]
    for number in range(part, ranges[3] - ranges[2], num_parts):
        triangle, source = first + number, ranges[2] + number
        corners, bounds = meshes.corners[source], triangles.bounds[triangle]
        a, b, c = corners[0] - ranges[0], corners[1] - ranges[0], corners[2] - ranges[0]
        found = add_triangle(
            vertices, a, b, c, shots.lens, shots.rings, size[1], size[0], triangles.edges[triangle],
            triangles.spans[triangle], bounds,
        )  # fmt: skip
        if found == 0:
            bounds[0], bounds[1], bounds[2], bounds[3] = 0, 0, 0, 0
            continue
        labels, colors, material = triangles.labels[triangle], triangles.colors[triangle], meshes.material[source]
        labels[INSTANCE_ROW] = item if item < num_objects else -1
        labels[SEMANTIC], labels[MATERIAL] = kind[ITEM_CLASS], material
        write_normal(vertices, a, b, c, colors)
        if is_colored:
            color_triangle(
                meshes, material, kind[PAINT], kind[GLOW], is_flat or found == 1, look.lights[frame], vertices, lights,
                (a, b, c), colors,
            )  # fmt: skip


@device_function(divides_by_zero=True)
def bound_instance(frame: int, place: int, items: Items, triangles: Triangles) -> None:
    """Write the bounds on the screen of an instance, those of its triangles in view."""
    instance, first = items.instances[frame, place], triangles.first[frame, 0]
    left = top = 1 << 30
    right = bottom = -(1 << 30)
    for triangle in range(first + instance[FIRST], first + instance[END]):
        bounds = triangles.bounds[triangle]
        if bounds[0] < bounds[2]:
            left, top = smaller(left, int(bounds[0])), smaller(top, int(bounds[1]))
            right, bottom = larger(right, int(bounds[2])), larger(bottom, int(bounds[3]))
    instance[LEFT], instance[TOP], instance[RIGHT], instance[BOTTOM] = left, top, right, bottom


@device_function(divides_by_zero=True)
def light_sky(
    frame: int, node_row: int, node: int, size: tuple[int, int], shots: Shots, look: Look, sky: Float32
) -> None:
    """Write the light of the sky at a node (4,) of ``sky`` (B, bands + 1, nodes, 4)."""
    row, column = smaller(node_row * BAND, size[0] - 1), smaller(node * SKY_STEP, size[1] - 1)
    light_node(
        row, column, shots.poses[frame], shots.lens, shots.rays, look.lights[frame], look.grain,
        sky[frame, node_row, node],
    )  # fmt: skip
    sky[frame, node_row, node, 3] = 1.0


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
        for triangle in range(first + instance[FIRST], first + instance[END]):
            bounds = triangles.bounds[triangle]
            if not (bounds[1] <= row < bounds[3] and bounds[0] <= column < bounds[2]):
                continue
            inverse = -1.0
            if is_pinhole:
                spans = triangles.spans[triangle]
                left, right = span_of(bounds, spans, row)
                if left <= column < right:
                    inverse = spans[9] + spans[11] * row + spans[10] * left + spans[10] * (column - left)
            else:
                ray = shots.rays[row, column]
                inverse = inverse_distance(triangles.edges[triangle], ray[0], ray[1], ray[2])
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
    slot, pose, light, lens, rays = shots.who[frame, 0], shots.poses[frame], look.lights[frame], shots.lens, shots.rays
    seen, number, band = memory.seen, row * size[1] + column, row // BAND
    memory.near[0], seen[0] = trace_pixel(frame, row, column, shots, items, triangles)
    aim_rays(row, column, 0, 1, pose, lens, rays, memory.exact)
    meet_ground(1, slot, pose, reach, ground, memory.near, seen, memory.exact)
    label_pixels(frame, number, slot, pose, ground, seen, triangles.labels, triangles.colors, memory.exact, pictures)
    if len(pictures.flow):
        write_flow(
            frame, number, size[1], slot, pose, lens, dt, motion, seen, triangles.labels, memory.exact, pictures.flow
        )
    if is_colored:
        scratch = FrameMemory(
            triangles.vertices, triangles.lights, triangles.edges, triangles.spans, triangles.colors, triangles.labels,
            triangles.bounds, items.instances[frame], items.shadows[frame], memory.near, seen, memory.exact,
            memory.shades, memory.cells, memory.texels, sky[frame, band : band + 2],
        )  # fmt: skip
        num_shadows = items.counts[frame, NUM_SHADOWS]
        color_tile(number, slot, pose, size, lens, rays, num_shadows, ground, light, look.grain, seen, scratch)
        expose(
            number, size, light, look.tone, seen, memory.texels, memory.shades,
            pictures.rgb[frame, number : number + 1],
        )  # fmt: skip
