"""Objects and triangles of frames drawn by thousands of threads: what one thread of a graphics card does.

A pixel, see ``thread_pixels``, is drawn by the functions that the processor's kernel calls for tiles, here with tiles
of one pixel. The steps of a call, each over all frames:

1. ``find_item`` for every object and fixture: whether it is in view, and its shadow.
2. ``list_items`` for every frame: those in view, and the places of their vertices and triangles.
3. ``place_part`` and ``set_up_part`` for parts of every instance: its vertices, then its triangles; then
   ``bound_instance``.
4. ``light_sky`` for every node of the sky, and ``stretch_sky`` between them.
5. ``draw_pixel`` for every pixel.
"""

from __future__ import annotations

from scenarionet_data.arrays.dtypes import Int32
from scenarionet_data.compiled.decorators import device_function
from scenarionet_sim.arrays.minmax import larger, smaller
from scenarionet_sim.cameras.draw.instances import (
    LEAST,
    LEAST_FIXED,
    appearance_of,
    casts_shadow,
    write_box,
)
from scenarionet_sim.cameras.draw.layout import (
    GROUP,
    HIDDEN,
    INSTANCE_ROW,
    IS_GLOSSY,
    KIND,
    MATERIAL,
    PINHOLE,
    SEMANTIC,
    SHADOW,
    TRIANGLE_END,
    TRIANGLE_FIRST,
    VERTEX_END,
    VERTEX_FIRST,
    Ground,
    Look,
    Meshes,
    Solids,
)
from scenarionet_sim.cameras.draw.lighting import color_of, color_triangle, light_vertices
from scenarionet_sim.cameras.draw.outlines import add_outline, color_outline, ends_of, is_upright
from scenarionet_sim.cameras.draw.placement import SMALL, may_be_outline, mesh_for, screen_radius, write_normal
from scenarionet_sim.cameras.draw.shadows import add_shadow
from scenarionet_sim.cameras.draw.thread_layout import (
    BOTTOM,
    COS,
    END,
    FIRST,
    FIRST_VERTEX,
    GLOW,
    HAS_SHADOW,
    IS_OUTLINE,
    IS_SMALL,
    ITEM_CLASS,
    LEFT,
    MESH,
    NUM_INSTANCES,
    NUM_SHADOWS,
    NUM_TRIANGLES,
    NUM_VERTICES,
    PAINT,
    RIGHT,
    SIN,
    SPIN,
    STEER,
    TOP,
    DrawingOptions,
    Items,
    Shots,
    Triangles,
)
from scenarionet_sim.cameras.draw.triangles import add_triangle
from scenarionet_sim.cameras.draw.vertices import place_vertex


@device_function(divides_by_zero=True)
def find_item(
    frame: int, item: int, size: tuple[int, int], options: DrawingOptions, shots: Shots, solids: Solids, ground: Ground,
    meshes: Meshes, look: Look, items: Items,
) -> None:  # fmt: skip
    """Write whether and how an object or a fixture is in view, and its shadow."""
    height, width = size
    are_boxes, is_colored, reach, _ = options
    slot, own, own_view = shots.owners[frame, 0], shots.owners[frame, 1], shots.owners[frame, 2]
    pose, light = shots.poses[frame], look.lights[frame]
    box, kind = items.boxes[frame, item], items.kinds[frame, item]
    kind[MESH], kind[HAS_SHADOW] = -1, 0
    rows = solids.motion.shape[1]
    if item >= rows + GROUP * (solids.fixed_range[slot, 1] - solids.fixed_range[slot, 0]):
        return
    if not write_box(item, slot, pose, reach, solids, ground, box):
        return
    is_object = item < rows
    has_shadows = is_colored and light[SHADOW] > 0.0 and shots.lens[KIND] == PINHOLE
    if has_shadows and casts_shadow(is_object, box, pose, shots.lens, width, height, light):
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
    kind[MESH], box[COS], box[SIN] = mesh_for(meshes, mesh, radius, box, pose)
    kind[ITEM_CLASS], kind[PAINT], kind[GLOW] = semantic, paint, glow
    kind[IS_SMALL], kind[IS_OUTLINE] = 1 if radius < SMALL else 0, 0
    if may_be_outline(meshes, kind[MESH], shots.lens):
        kind[IS_OUTLINE] = 1 if is_upright(ends_of(meshes.outlines[kind[MESH]], box, pose, shots.lens)) else 0
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
            num_vertices += ranges[VERTEX_END] - ranges[VERTEX_FIRST]
            num_triangles += ranges[TRIANGLE_END] - ranges[TRIANGLE_FIRST]
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
    if items.kinds[frame, item, IS_OUTLINE]:
        return
    box, mesh = items.boxes[frame, item], int(items.kinds[frame, item, MESH])
    turn, ranges = (box[COS], box[SIN]), meshes.ranges[mesh]
    first = triangles.first[frame, 1] + items.instances[frame, place, FIRST_VERTEX]
    for number in range(part, ranges[VERTEX_END] - ranges[VERTEX_FIRST], num_parts):
        vertex = triangles.vertices[:, first + number : first + number + 1]
        lights = triangles.lights[:, first + number : first + number + 1]
        place_vertex(
            meshes,
            mesh,
            ranges[VERTEX_FIRST] + number,
            0,
            box,
            turn,
            box[SPIN],
            box[STEER],
            shots.poses[frame],
            shots.lens,
            vertex,
            lights,
        )
        if is_colored:
            light_vertices(look.lights[frame], turn, 1, ranges[IS_GLOSSY] > 0, vertex, lights)


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
    if kind[IS_OUTLINE]:
        if part == 0:
            set_up_outline(frame, item, first, size, num_objects, shots, meshes, look, items, triangles)
        for number in range(part, ranges[TRIANGLE_END] - ranges[TRIANGLE_FIRST], num_parts):
            if number > 0:
                empty_bounds(triangles.bounds[first + number])
        return
    lowest, end = ranges[VERTEX_FIRST], begin + ranges[VERTEX_END] - ranges[VERTEX_FIRST]
    vertices, lights = triangles.vertices[:, begin:end], triangles.lights[:, begin:end]
    for number in range(part, ranges[TRIANGLE_END] - ranges[TRIANGLE_FIRST], num_parts):
        triangle, source = first + number, ranges[TRIANGLE_FIRST] + number
        corners, bounds = meshes.corners[source], triangles.bounds[triangle]
        a, b, c = corners[0] - lowest, corners[1] - lowest, corners[2] - lowest
        found = add_triangle(
            vertices, a, b, c, shots.lens, shots.rings, size[1], size[0], triangles.edges[triangle],
            triangles.spans[triangle], bounds,
        )  # fmt: skip
        if found == 0:
            empty_bounds(bounds)
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
def set_up_outline(
    frame: int, item: int, triangle: int, size: tuple[int, int], num_objects: int, shots: Shots, meshes: Meshes,
    look: Look, items: Items, triangles: Triangles,
) -> None:  # fmt: skip
    """Write the outline that stands for an item as its first triangle."""
    kind, box, pose, lens = items.kinds[frame, item], items.boxes[frame, item], shots.poses[frame], shots.lens
    outline, bounds, labels = meshes.outlines[kind[MESH]], triangles.bounds[triangle], triangles.labels[triangle]
    ends, turn, spans = ends_of(outline, box, pose, lens), (box[COS], box[SIN]), triangles.spans[triangle]
    if not add_outline(outline, ends, turn, box, pose, lens, size[1], size[0], spans, bounds):
        empty_bounds(bounds)
        return
    material = int(meshes.material[meshes.ranges[kind[MESH], TRIANGLE_FIRST]])
    labels[INSTANCE_ROW] = item if item < num_objects else -1
    labels[SEMANTIC], labels[MATERIAL] = kind[ITEM_CLASS], material
    color_outline(
        meshes.colors[color_of(material, kind[PAINT])], box, pose, look.lights[frame], triangles.colors[triangle]
    )


@device_function
def empty_bounds(bounds: Int32) -> None:
    """Write the bounds of a triangle that is not in view."""
    bounds[0], bounds[1], bounds[2], bounds[3] = 0, 0, 0, 0


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
