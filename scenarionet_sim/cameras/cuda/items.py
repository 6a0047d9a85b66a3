"""What one thread of a graphics card does for objects and triangles, with the functions of ``cameras.draw``.

The steps of a call, each over all frames; see ``pixels`` for the last two:

1. ``find_item`` for every object and fixture: whether it is in view, and its shadow.
2. ``list_items`` for every frame: those in view, and the places of their triangles.
3. ``set_up_part`` for parts of every instance: its triangles; then ``bound_instance``.
4. ``light_sky`` for every node of the sky, and ``stretch_sky`` between them.
5. ``draw_pixel`` for every pixel.
"""

from __future__ import annotations

from typing import NamedTuple

from scenarionet_data.arrays.dtypes import Float64, Int32
from scenarionet_data.compiled.decorators import device_function
from scenarionet_sim.arrays.minmax import larger, smaller
from scenarionet_sim.cameras.draw import codes
from scenarionet_sim.cameras.draw import columns as at
from scenarionet_sim.cameras.draw.instances import (
    LEAST,
    LEAST_FIXED,
    appearance_of,
    caster_of,
    casts_shadow,
    has_shadows,
    source_of,
    write_box,
)
from scenarionet_sim.cameras.draw.lighting import light_vertices
from scenarionet_sim.cameras.draw.outlines import ends_of, is_upright
from scenarionet_sim.cameras.draw.placement import (
    SMALL,
    may_be_outline,
    mesh_for,
    screen_radius,
    set_up_outline,
    set_up_triangle,
)
from scenarionet_sim.cameras.draw.shadows import NUM_SHADOW, add_light, add_shadow, light_at
from scenarionet_sim.cameras.draw.structures import (
    GROUP,
    FrameView,
    Item,
    Look,
    SceneArrays,
    Shots,
    Triangles,
    Vertices,
)
from scenarionet_sim.cameras.draw.vertices import place_vertices

SPIN, STEER, SWING, COS, SIN, NUM_BOX = 7, 8, 9, 10, 11, 12
"""Columns of ``Items.boxes`` behind x, y, z, heading, length, width, height; and their number."""

MESH, ITEM_CLASS, PAINT, GLOW, HAS_SHADOW, IS_SMALL, NUM_ITEM = range(7)
"""Columns of ``Items.kinds``: mesh to draw or -1, class, paint, shining material or -1, whether there is a shadow, and
whether triangles have one colour; and their number."""

FIRST, END, LEFT, TOP, RIGHT, BOTTOM, IS_OUTLINE, NUM_INSTANCE = range(8)
"""Columns of ``Items.instances``: triangles, counted from the first one of the frame, bounds on the screen [pixels],
and whether an outline stands for all triangles; and their number."""

NUM_INSTANCES, NUM_SHADOWS, NUM_TRIANGLES, NUM_COUNTS = range(4)
"""Columns of ``Items.counts``, and their number."""

LANES = 32
"""Threads that share the triangles of an instance."""


class Items(NamedTuple):
    """Objects and fixtures of B frames, N each.

    Attributes:
        boxes: (B, N, NUM_BOX), see above.
        kinds: (B, N, NUM_ITEM), see above.
        shadows: (B, N, NUM_SHADOW) see ``FrameMemory.shadows``; after ``list_items`` the first ones are those in view.
        drawn: (B, N) items in view.
        instances: (B, N, NUM_INSTANCE) see above, of the items in ``drawn``.
        counts: (B, NUM_COUNTS), see above.
        first: (B,) first triangle of each frame in ``Triangles``, where those out of view have empty bounds.
    """

    boxes: Float64
    kinds: Int32
    shadows: Float64
    drawn: Int32
    instances: Int32
    counts: Int32
    first: Int32


@device_function(allocates=True)
def view_of(frame: int, shots: Shots, look: Look) -> FrameView:
    """Return the camera of a frame."""
    return FrameView(
        shots.owners[frame, 0], shots.owners[frame, 1], shots.owners[frame, 2], shots.poses[frame], look.lights[frame],
        shots.lens, shots.rays, shots.rings, shots.width, shots.height, shots.reach, shots.flow_time, shots.are_boxes,
        shots.is_colored,
    )  # fmt: skip


@device_function(allocates=True)
def item_of(frame: int, place: int, num_objects: int, view: FrameView, items: Items) -> Item:
    """Return an instance in view."""
    number = items.drawn[frame, place]
    box, kind = items.boxes[frame, number], items.kinds[frame, number]
    lit = 1.0
    if has_shadows(view) and view.light[at.NIGHT] > 0.0:
        lit = light_at(box[0], box[1], items.shadows[frame, : items.counts[frame, NUM_SHADOWS]])
    return Item(
        number if number < num_objects else -1, box, kind[MESH], (box[COS], box[SIN]), kind[ITEM_CLASS], kind[PAINT],
        kind[GLOW], (box[SPIN], box[STEER], box[SWING]), kind[IS_SMALL] == 1, lit,
    )  # fmt: skip


@device_function(allocates=True, divides_by_zero=True)
def find_item(frame: int, number: int, shots: Shots, scene: SceneArrays, items: Items) -> None:
    """Write whether and how an object or a fixture is in view, and its shadow."""
    view, solids, meshes = view_of(frame, shots, scene.look), scene.solids, scene.meshes
    box, kind, rows = items.boxes[frame, number], items.kinds[frame, number], solids.motion.shape[1]
    kind[MESH], kind[HAS_SHADOW] = -1, 0
    if number >= rows + GROUP * (solids.fixed_range[view.slot, 1] - solids.fixed_range[view.slot, 0]):
        return
    if not write_box(number, view, solids, scene.ground, box):
        return
    shadow, source = items.shadows[frame, number : number + 1], source_of(number, view, solids)
    if has_shadows(view) and source >= 0:
        kind[HAS_SHADOW] = add_light(box, source, view, shadow, 0)
    elif has_shadows(view) and casts_shadow(number < rows, box, view):
        kind[HAS_SHADOW] = add_shadow(box, caster_of(number, view.slot, solids), view, shadow, 0)
    radius = screen_radius(box, view)
    is_hidden = number == view.own and view.own_view == codes.HIDDEN
    if is_hidden or radius < (LEAST if number < rows else LEAST_FIXED):
        return
    mesh, kind[ITEM_CLASS], kind[PAINT], kind[GLOW], moves = appearance_of(number, view, solids, box)
    box[SPIN], box[STEER], box[SWING] = moves
    kind[MESH], box[COS], box[SIN] = mesh_for(meshes, mesh, radius, box, view.pose)
    kind[IS_SMALL] = 1 if radius < SMALL else 0


@device_function(divides_by_zero=True)
def list_items(frame: int, scene: SceneArrays, items: Items) -> None:
    """List the instances in view of a frame and its shadows, and count its triangles."""
    count, num_triangles, num_shadows = 0, 0, 0
    for number in range(items.kinds.shape[1]):
        kind = items.kinds[frame, number]
        if kind[HAS_SHADOW]:
            for column in range(NUM_SHADOW):
                items.shadows[frame, num_shadows, column] = items.shadows[frame, number, column]
            num_shadows += 1
        if kind[MESH] >= 0:
            ranges, instance = scene.meshes.ranges[kind[MESH]], items.instances[frame, count]
            items.drawn[frame, count] = number
            instance[FIRST], instance[IS_OUTLINE] = num_triangles, 0
            num_triangles += ranges[at.TRIANGLE_END] - ranges[at.TRIANGLE_FIRST]
            instance[END] = num_triangles
            count += 1
    counts = items.counts[frame]
    counts[NUM_INSTANCES], counts[NUM_SHADOWS], counts[NUM_TRIANGLES] = count, num_shadows, num_triangles


@device_function(allocates=True, divides_by_zero=True)
def set_up_part(
    frame: int, place: int, lane: int, shots: Shots, scene: SceneArrays, items: Items, vertices: Vertices,
    triangles: Triangles,
) -> None:  # fmt: skip
    """Write every ``LANES``-th triangle of an instance from number ``lane`` on; ``vertices`` has memory for three."""
    view, meshes, instance = view_of(frame, shots, scene.look), scene.meshes, items.instances[frame, place]
    item = item_of(frame, place, scene.solids.motion.shape[1], view, items)
    first = items.first[frame] + instance[FIRST]
    ranges = meshes.ranges[item.mesh]
    if may_be_outline(meshes, item.mesh, view.lens):
        ends = ends_of(meshes.outlines[item.mesh], item.box, view.pose, view.lens)
        if is_upright(ends):
            if lane == 0:
                instance[IS_OUTLINE], instance[END] = 1, instance[FIRST] + 1
                if not set_up_outline(ends, first, item, view, meshes, triangles):
                    triangles.bounds[first, 2] = triangles.bounds[first, 0]
            return
    for number in range(lane, ranges[at.TRIANGLE_END] - ranges[at.TRIANGLE_FIRST], LANES):
        source = ranges[at.TRIANGLE_FIRST] + number
        for corner in range(3):
            spot, light = vertices.places[:, corner : corner + 1], vertices.lights[:, corner : corner + 1]
            place_vertices(meshes.corners[source, corner], 1, item, view, meshes, spot, light)
            if view.is_colored:
                light_vertices(view, item, 1, ranges[at.IS_GLOSSY] > 0, spot, light)
        if not set_up_triangle(source, (0, 1, 2), first + number, item, view, meshes, vertices, triangles):
            bounds = triangles.bounds[first + number]
            bounds[0], bounds[1], bounds[2], bounds[3] = 0, 0, 0, 0


@device_function(divides_by_zero=True)
def bound_instance(frame: int, place: int, items: Items, triangles: Triangles) -> None:
    """Write the bounds on the screen of an instance, those of its triangles in view."""
    instance, first = items.instances[frame, place], items.first[frame]
    left = top = 1 << 30
    right = bottom = -(1 << 30)
    for triangle in range(first + instance[FIRST], first + instance[END]):
        bounds = triangles.bounds[triangle]
        if bounds[0] < bounds[2]:
            left, top = smaller(left, int(bounds[0])), smaller(top, int(bounds[1]))
            right, bottom = larger(right, int(bounds[2])), larger(bottom, int(bounds[3]))
    instance[LEFT], instance[TOP], instance[RIGHT], instance[BOTTOM] = left, top, right, bottom
