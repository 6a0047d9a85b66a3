"""Meshes in view: their vertices before the camera, and their triangles with the light on their corners."""

from __future__ import annotations

import math

from scenarionet_data.arrays.dtypes import Float32, Float64
from scenarionet_data.compiled.decorators import device_function
from scenarionet_sim.arrays.minmax import larger, smaller
from scenarionet_sim.cameras.draw import codes
from scenarionet_sim.cameras.draw import columns as at
from scenarionet_sim.cameras.draw.facades import lay_out_wall
from scenarionet_sim.cameras.draw.lighting import color_of, color_triangle, light_vertices
from scenarionet_sim.cameras.draw.outlines import Ends, add_outline, color_outline, ends_of, is_upright
from scenarionet_sim.cameras.draw.structures import FrameMemory, FrameView, Item, Meshes, Triangles, Vertices
from scenarionet_sim.cameras.draw.triangles import add_triangle
from scenarionet_sim.cameras.draw.vertices import place_vertices

SMALL = 10.0
"""Radius on the screen [pixels] below which the light is the same everywhere on a triangle."""

STEEP_VIEW = 0.5
"""Slope of the view on an object from which on it is not drawn by meshes that have one side only."""


@device_function(forceinline=True, divides_by_zero=True, in_lanes=True)
def screen_radius(box: Float64, view: FrameView) -> float:
    """Return the radius [pixels] of the ball around a box on the screen; -1 if no pixel can show it."""
    pose, lens = view.pose, view.lens
    radius = 0.5 * math.sqrt(box[4] ** 2 + box[5] ** 2 + box[6] ** 2) + 0.1
    wx, wy, wz = box[0] - pose[at.EYE], box[1] - pose[at.EYE + 1], box[2] + 0.5 * box[6] - pose[at.EYE + 2]
    far = math.sqrt(wx * wx + wy * wy + wz * wz)
    if not far - radius <= view.reach:  # not a number either
        return -1.0
    if lens[at.KIND] == codes.PINHOLE and is_beside_picture(wx, wy, wz, radius, view):
        return -1.0
    return float(lens[at.FX] * radius / larger(far, 0.1))


@device_function(forceinline=True, divides_by_zero=True, in_lanes=True)
def is_beside_picture(wx: float, wy: float, wz: float, radius: float, view: FrameView) -> bool:
    """Whether no part of a ball, whose middle is seen from the camera in the scenario's frame, is in the picture."""
    pose, lens = view.pose, view.lens
    z = pose[at.FORWARD] * wx + pose[at.FORWARD + 1] * wy + pose[at.FORWARD + 2] * wz
    if z < -radius:
        return True
    x = pose[at.RIGHT] * wx + pose[at.RIGHT + 1] * wy + pose[at.RIGHT + 2] * wz
    side = larger(lens[at.CX], view.width - lens[at.CX])
    if abs(x) * lens[at.FX] - z * side > radius * math.sqrt(lens[at.FX] * lens[at.FX] + side * side):
        return True
    y = pose[at.DOWN] * wx + pose[at.DOWN + 1] * wy + pose[at.DOWN + 2] * wz
    rise = larger(lens[at.CY], view.height - lens[at.CY])
    return bool(abs(y) * lens[at.FY] - z * rise > radius * math.sqrt(lens[at.FY] * lens[at.FY] + rise * rise))


@device_function(divides_by_zero=True, in_lanes=True)
def mesh_for(meshes: Meshes, mesh: int, radius: float, box: Float64, pose: Float64) -> tuple[int, float, float]:
    """Return the mesh to draw of a box that is seen under a radius [pixels], and cosine and sine of its heading."""
    x, y, z = box[0] - pose[at.EYE], box[1] - pose[at.EYE + 1], box[2] + 0.5 * box[6] - pose[at.EYE + 2]
    flat = math.sqrt(x * x + y * y)
    while radius < meshes.ranges[mesh, at.COARSER_BELOW]:
        coarser = meshes.ranges[mesh, at.COARSER]
        if meshes.ranges[coarser, at.IS_ONE_SIDED] and abs(z) > STEEP_VIEW * flat:
            break
        mesh = coarser
    if meshes.ranges[mesh, at.IS_ONE_SIDED]:
        per = 1.0 / larger(flat, 1e-6)
        return mesh, x * per, y * per
    return mesh, math.cos(box[3]), math.sin(box[3])


@device_function(divides_by_zero=True, in_lanes=True)
def write_normal(vertices: Float64, a: int, b: int, c: int, colors: Float32) -> None:
    """Write the normal of a triangle into the last columns of ``colors`` (12,)."""
    xs, ys, zs = vertices[at.AWAY], vertices[at.AWAY + 1], vertices[at.AWAY + 2]
    ux, uy, uz = xs[b] - xs[a], ys[b] - ys[a], zs[b] - zs[a]
    vx, vy, vz = xs[c] - xs[a], ys[c] - ys[a], zs[c] - zs[a]
    nx, ny, nz = uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx
    unit = 1.0 / math.sqrt(nx * nx + ny * ny + nz * nz + 1e-30)
    colors[9], colors[10], colors[11] = nx * unit, ny * unit, nz * unit


@device_function(forceinline=True, divides_by_zero=True, in_lanes=True)
def set_up_triangle(
    source: int, corners: tuple[int, int, int], number: int, item: Item, view: FrameView, meshes: Meshes,
    vertices: Vertices, triangles: Triangles,
) -> bool:  # fmt: skip
    """Write a triangle of a mesh whose vertices are placed; return whether it may be in view.

    Args:
        source: Triangle of all meshes.
        corners: Its vertices in ``vertices``.
        number: Where to write in ``triangles``.
        item, view, meshes, vertices, triangles: See ``structures``.
    """
    a, b, c = corners
    edges, spans, bounds = triangles.edges[number], triangles.spans[number], triangles.bounds[number]
    found = add_triangle(vertices.places, a, b, c, view, edges, spans, bounds)
    if found == 0:
        return False
    material = meshes.material[source]
    labels, colors = triangles.labels[number], triangles.colors[number]
    labels[at.INSTANCE_ROW], labels[at.SEMANTIC], labels[at.MATERIAL] = item.row, item.semantic, material
    write_normal(vertices.places, a, b, c, colors)
    if view.is_colored:
        is_flat = item.is_small or found == 1 or material == codes.FACADE
        color_triangle(corners, material, is_flat, item, view.light, meshes, vertices, colors)
        if material == codes.FACADE:
            lay_out_wall(item, view.pose, view.lens[at.FX], colors)
    return True


@device_function(forceinline=True, divides_by_zero=True, in_lanes=True)
def set_up_outline(ends: Ends, number: int, item: Item, view: FrameView, meshes: Meshes, triangles: Triangles) -> bool:
    """Write the outline that stands for an item as triangle ``number``; return whether it is in view."""
    outline, labels = meshes.outlines[item.mesh], triangles.labels[number]
    if not add_outline(outline, ends, item, view, triangles.spans[number], triangles.bounds[number]):
        return False
    material = int(meshes.material[meshes.ranges[item.mesh, at.TRIANGLE_FIRST]])
    labels[at.INSTANCE_ROW], labels[at.SEMANTIC], labels[at.MATERIAL] = item.row, item.semantic, material
    color = meshes.colors[color_of(material, item.paint)]
    color_outline(color, item, view.pose, view.light, triangles.colors[number])
    return True


@device_function(forceinline=True, divides_by_zero=True, in_lanes=True)
def add_instance(
    item: Item, view: FrameView, meshes: Meshes, scratch: FrameMemory, count: tuple[int, int]
) -> tuple[int, int]:
    """Add an item; return the new numbers of triangles and instances."""
    num_triangles, num_instances = count
    mesh, triangles, most = item.mesh, scratch.triangles, len(scratch.triangles.labels)
    if may_be_outline(meshes, mesh, view.lens) and num_triangles < most:
        ends = ends_of(meshes.outlines[mesh], item.box, view.pose, view.lens)
        if is_upright(ends):
            if not set_up_outline(ends, num_triangles, item, view, meshes, triangles):
                return count
            bounds = triangles.bounds[num_triangles]
            list_instance(num_triangles, num_triangles + 1, int(bounds[1]), int(bounds[3]), 1, scratch, num_instances)
            return num_triangles + 1, num_instances + 1
    first, vertices = int(meshes.ranges[mesh, at.VERTEX_FIRST]), scratch.vertices
    num_vertices = int(meshes.ranges[mesh, at.VERTEX_END]) - first
    place_vertices(first, num_vertices, item, view, meshes, vertices.places, vertices.lights)
    if view.is_colored:
        is_glossy = meshes.ranges[mesh, at.IS_GLOSSY] > 0
        light_vertices(view, item, num_vertices, is_glossy, vertices.places, vertices.lights)
    after, top, bottom = num_triangles, view.height, 0
    for t in range(meshes.ranges[mesh, at.TRIANGLE_FIRST], meshes.ranges[mesh, at.TRIANGLE_END]):
        if after >= most:
            break
        corners = meshes.corners[t, 0] - first, meshes.corners[t, 1] - first, meshes.corners[t, 2] - first
        if set_up_triangle(t, corners, after, item, view, meshes, vertices, triangles):
            top = smaller(top, int(triangles.bounds[after, 1]))
            bottom = larger(bottom, int(triangles.bounds[after, 3]))
            after += 1
    if after == num_triangles:
        return count
    list_instance(num_triangles, after, top, bottom, 0, scratch, num_instances)
    return after, num_instances + 1


@device_function(forceinline=True, in_lanes=True)
def list_instance(
    first: int, end: int, top: int, bottom: int, is_outline: int, scratch: FrameMemory, place: int
) -> None:
    """Write the row of an instance in view."""
    instance = scratch.instances[place]
    instance[at.TRI_FIRST], instance[at.TRI_END], instance[at.TOP], instance[at.BOTTOM] = first, end, top, bottom
    instance[at.IS_OUTLINE] = is_outline


@device_function(forceinline=True, divides_by_zero=True)
def may_be_outline(meshes: Meshes, mesh: int, lens: Float64) -> bool:
    """Whether an outline stands for a mesh."""
    return bool(lens[at.KIND] == codes.PINHOLE and meshes.outlines[mesh, at.WIDE] > 0.0)
