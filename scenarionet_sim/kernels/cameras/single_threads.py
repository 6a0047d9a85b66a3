"""Frames drawn by thousands of threads: what one thread of a graphics card does in each step of drawing.

The functions of rows are those of the processor's kernel, here with rows of one pixel. A call of ``draw_frames`` is
five steps, each of them over all frames:

1. ``find_item`` for every object and fixture: whether it is in view, and its shadow.
2. ``list_items`` for every frame: those in view, and the places of their triangles.
3. ``write_triangle`` for every triangle of an instance in view, then ``bound_instance`` for every instance.
4. ``light_sky`` for every node of the sky.
5. ``draw_pixel`` for every pixel.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from scenarionet_data.arrays.compiled import device_function
from scenarionet_data.arrays.dtypes import Float32, Float64, Int32
from scenarionet_sim.kernels.cameras.instances import (
    LEAST,
    LEAST_FIXED,
    appearance_of,
    casts_shadow,
    write_box,
)
from scenarionet_sim.kernels.cameras.labels import flow_row, label_row
from scenarionet_sim.kernels.cameras.layout import (
    BAND,
    BOTTOM,
    FX,
    HIDDEN,
    INSTANCE_ROW,
    IS_FLAT,
    KIND,
    LEFT,
    MATERIAL,
    PINHOLE,
    RIGHT_END,
    SEMANTIC,
    SHADOW,
    SKY_STEP,
    TOP,
    TRI_END,
    TRI_FIRST,
    Ground,
    Look,
    Meshes,
    Pictures,
    Solids,
)
from scenarionet_sim.kernels.cameras.paving import color_ground
from scenarionet_sim.kernels.cameras.placement import (
    SMALL,
    color_triangle,
    mesh_for,
    place_vertex,
    screen_radius,
    write_normal,
)
from scenarionet_sim.kernels.cameras.rows import aim_rays, meet_ground
from scenarionet_sim.kernels.cameras.shading import cast_shadows, color_triangles, expose
from scenarionet_sim.kernels.cameras.shadows import add_shadow
from scenarionet_sim.kernels.cameras.sky import color_sky, light_node
from scenarionet_sim.kernels.cameras.triangles import add_triangle, inverse_distance, span_of
from scenarionet_sim.kernels.minmax import larger, smaller

SPIN, STEER, NUM_BOX = 7, 8, 9
"""Columns of ``Items.boxes`` behind x, y, z, heading, length, width, height; and their number."""

MESH, ITEM_CLASS, PAINT, GLOW, HAS_SHADOW, IS_SMALL, NUM_ITEM = range(7)
"""Columns of ``Items.kinds``: mesh to draw or -1, class, paint, shining material or -1, whether there is a shadow, and
whether triangles have one colour; and their number."""

NUM_INSTANCES, NUM_SHADOWS, NUM_TRIANGLES, NUM_COUNTS = range(4)
"""Columns of ``Items.counts``, and their number."""

Options = tuple[bool, bool, float, float]
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
        instances: (B, N, 6) see ``FrameMemory.instances``, for the items in ``drawn``.
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
        first: (B,) first triangle of each frame.
        edges, spans, colors, labels, bounds: (T, 12), (T, 12), (T, 12), (T, 4), (T, 4).
    """

    first: Int32
    edges: Float64
    spans: Float64
    colors: Float32
    labels: Int32
    bounds: Int32


@device_function(divides_by_zero=True)
def find_item(
    frame: int, item: int, size: tuple[int, int], options: Options, shots: Shots, solids: Solids, ground: Ground,
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
    """List the instances in view of a frame and its shadows, count its triangles."""
    count, num_triangles, num_shadows = 0, 0, 0
    for item in range(items.kinds.shape[1]):
        kind = items.kinds[frame, item]
        if kind[HAS_SHADOW]:
            for column in range(12):
                items.shadows[frame, num_shadows, column] = items.shadows[frame, item, column]
            num_shadows += 1
        if kind[MESH] >= 0:
            items.drawn[frame, count] = item
            items.instances[frame, count, TRI_FIRST] = num_triangles
            num_triangles += meshes.ranges[kind[MESH], 3] - meshes.ranges[kind[MESH], 2]
            items.instances[frame, count, TRI_END] = num_triangles
            count += 1
    items.counts[frame, NUM_INSTANCES], items.counts[frame, NUM_SHADOWS] = count, num_shadows
    items.counts[frame, NUM_TRIANGLES] = num_triangles


@device_function(divides_by_zero=True)
def write_triangle(
    frame: int, place: int, number: int, size: tuple[int, int], is_colored: bool, shots: Shots, solids: Solids,
    meshes: Meshes, look: Look, items: Items, triangles: Triangles, vertices: Float64,
) -> None:  # fmt: skip
    """Write a triangle of an instance.

    Args:
        frame, place, number: Frame, instance of the frame, triangle of the instance.
        size: Height and width [pixels].
        is_colored: Whether colours are wanted.
        shots, solids, meshes, look, items: The scenes.
        triangles: Output.
        vertices: (3, 12) memory of the thread.
    """
    height, width = size
    item = items.drawn[frame, place]
    box, kind, pose = items.boxes[frame, item], items.kinds[frame, item], shots.poses[frame]
    mesh = int(kind[MESH])
    source = meshes.ranges[mesh, 2] + number
    triangle = triangles.first[frame] + items.instances[frame, place, TRI_FIRST] + number
    turn = math.cos(box[3]), math.sin(box[3])
    for corner in range(3):
        place_vertex(
            meshes, mesh, meshes.corners[source, corner], box, turn, box[SPIN], box[STEER], pose, shots.lens,
            vertices[corner],
        )  # fmt: skip
    bounds = triangles.bounds[triangle]
    if not add_triangle(
        vertices, 0, 1, 2, shots.lens, shots.rings, width, height, triangles.edges[triangle], triangles.spans[triangle],
        bounds,
    ):  # fmt: skip
        bounds[0], bounds[1], bounds[2], bounds[3] = 0, 0, 0, 0
        return
    labels, colors, material = triangles.labels[triangle], triangles.colors[triangle], meshes.material[source]
    labels[INSTANCE_ROW] = item if item < solids.motion.shape[1] else -1
    labels[SEMANTIC], labels[MATERIAL], labels[IS_FLAT] = kind[ITEM_CLASS], material, kind[IS_SMALL]
    write_normal(vertices, 0, 1, 2, colors)
    if is_colored:
        color_triangle(
            meshes, material, kind[PAINT], kind[GLOW], kind[IS_SMALL] == 1, look.lights[frame], vertices, (0, 1, 2),
            colors,
        )  # fmt: skip


@device_function(divides_by_zero=True)
def bound_instance(frame: int, place: int, items: Items, triangles: Triangles) -> None:
    """Write the bounds on the screen of an instance, those of its triangles in view."""
    instance, first = items.instances[frame, place], triangles.first[frame]
    left = top = 1 << 30
    right = bottom = -(1 << 30)
    for triangle in range(first + instance[TRI_FIRST], first + instance[TRI_END]):
        bounds = triangles.bounds[triangle]
        if bounds[0] < bounds[2]:
            left, top = smaller(left, int(bounds[0])), smaller(top, int(bounds[1]))
            right, bottom = larger(right, int(bounds[2])), larger(bottom, int(bounds[3]))
    instance[LEFT], instance[TOP], instance[RIGHT_END], instance[BOTTOM] = left, top, right, bottom


@device_function(divides_by_zero=True)
def light_sky(
    frame: int, node_row: int, node: int, size: tuple[int, int], shots: Shots, look: Look, sky: Float64
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
    near, seen, first = 0.0, -1, triangles.first[frame]
    is_pinhole = shots.lens[KIND] == PINHOLE
    for place in range(items.counts[frame, NUM_INSTANCES]):
        instance = items.instances[frame, place]
        if not (instance[TOP] <= row < instance[BOTTOM] and instance[LEFT] <= column < instance[RIGHT_END]):
            continue
        for triangle in range(first + instance[TRI_FIRST], first + instance[TRI_END]):
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
                near, seen = inverse, triangle
    return near, seen


@device_function(divides_by_zero=True)
def draw_pixel(
    frame: int, row: int, column: int, size: tuple[int, int], options: Options, shots: Shots, motion: Float64,
    ground: Ground, look: Look, items: Items, triangles: Triangles, sky: Float64, near: Float64, seen: Int32,
    cells: Int32, texels: Int32, values: Float64, pictures: Pictures,
) -> None:  # fmt: skip
    """Write all channels of a pixel.

    Args:
        frame, row, column: The pixel.
        size, options, shots, motion, ground, look, items, triangles, sky: The scenes, see above.
        near, seen, cells, texels, values: (1,), (1,), (1,), (1,), (KERB_SHARE + 1, 1) memory of the thread.
        pictures: Outputs.
    """
    _, is_colored, reach, dt = options
    slot, pose, light, lens, rays = shots.who[frame, 0], shots.poses[frame], look.lights[frame], shots.lens, shots.rays
    near[0], seen[0] = trace_pixel(frame, row, column, shots, items, triangles)
    aim_rays(row, column, 1, pose, lens, rays, values)
    meet_ground(1, slot, pose, reach, ground, near, seen, values)
    labels, colors = triangles.labels, triangles.colors
    label_row(frame, row, column, 1, slot, ground, seen, labels, colors, values, pictures)
    if len(pictures.flow):
        flow_row(frame, row, column, 1, slot, pose, lens, dt, motion, seen, labels, values, pictures.flow)
    if is_colored:
        band = row // BAND
        cast_shadows(row, column, 1, items.counts[frame, NUM_SHADOWS], light[SHADOW], values, items.shadows[frame])
        color_sky(row, column, 1, size, pose, lens, rays, light, look.grain, seen, sky[frame, band : band + 2], values)
        color_ground(1, slot, 1.0 / lens[FX], ground, light, look.grain, seen, cells, texels, values)
        color_triangles(row, column, 1, pose, lens, rays, triangles.edges, colors, labels, seen, values)
        expose(
            row, column, 1, size, light, look.tone, seen, texels, values,
            pictures.rgb[frame, row, column : column + 1],
        )  # fmt: skip
