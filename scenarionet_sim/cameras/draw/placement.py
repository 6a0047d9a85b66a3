"""Meshes in view: their vertices before the camera, and their triangles with the light on their corners."""

from __future__ import annotations

import math

from scenarionet_data.arrays.dtypes import Float32, Float64
from scenarionet_data.compiled.decorators import device_function
from scenarionet_sim.arrays.minmax import larger, smaller
from scenarionet_sim.cameras.draw.layout import (
    AWAY,
    BOTTOM,
    COARSER,
    COARSER_BELOW,
    CX,
    CY,
    DOWN,
    EYE,
    FACADE,
    FORWARD,
    FX,
    FY,
    INSTANCE_ROW,
    IS_GLOSSY,
    IS_ONE_SIDED,
    IS_OUTLINE,
    KIND,
    MATERIAL,
    PINHOLE,
    RIGHT,
    SEMANTIC,
    TOP,
    TRI_END,
    TRI_FIRST,
    TRIANGLE_END,
    TRIANGLE_FIRST,
    VERTEX_FIRST,
    WIDE,
    FrameMemory,
    Meshes,
)
from scenarionet_sim.cameras.draw.lighting import color_of, color_triangle, light_vertices
from scenarionet_sim.cameras.draw.outlines import add_outline, color_outline, ends_of, is_upright
from scenarionet_sim.cameras.draw.triangles import add_triangle
from scenarionet_sim.cameras.draw.vertices import place_vertices

SMALL = 10.0
"""Radius on the screen [pixels] below which the light is the same everywhere on a triangle."""

STEEP_VIEW = 0.5
"""Slope of the view on an object from which on it is not drawn by meshes that have one side only."""


@device_function(forceinline=True, divides_by_zero=True, in_lanes=True)
def screen_radius(box: Float64, pose: Float64, lens: Float64, width: int, height: int, reach: float) -> float:
    """Return the radius [pixels] of the ball around a box on the screen; -1 if no pixel can show it."""
    radius = 0.5 * math.sqrt(box[4] ** 2 + box[5] ** 2 + box[6] ** 2) + 0.1
    wx, wy, wz = box[0] - pose[EYE], box[1] - pose[EYE + 1], box[2] + 0.5 * box[6] - pose[EYE + 2]
    far = math.sqrt(wx * wx + wy * wy + wz * wz)
    if not far - radius <= reach:  # not a number either
        return -1.0
    if lens[KIND] == PINHOLE and is_beside_picture(wx, wy, wz, radius, pose, lens, width, height):
        return -1.0
    return float(lens[FX] * radius / larger(far, 0.1))


@device_function(forceinline=True, divides_by_zero=True, in_lanes=True)
def is_beside_picture(
    wx: float, wy: float, wz: float, radius: float, pose: Float64, lens: Float64, width: int, height: int
) -> bool:
    """Whether no part of a ball, whose middle is seen from the camera in the scenario's frame, is in the picture."""
    z = pose[FORWARD] * wx + pose[FORWARD + 1] * wy + pose[FORWARD + 2] * wz
    if z < -radius:
        return True
    x = pose[RIGHT] * wx + pose[RIGHT + 1] * wy + pose[RIGHT + 2] * wz
    side = larger(lens[CX], width - lens[CX])
    if abs(x) * lens[FX] - z * side > radius * math.sqrt(lens[FX] * lens[FX] + side * side):
        return True
    y = pose[DOWN] * wx + pose[DOWN + 1] * wy + pose[DOWN + 2] * wz
    rise = larger(lens[CY], height - lens[CY])
    return bool(abs(y) * lens[FY] - z * rise > radius * math.sqrt(lens[FY] * lens[FY] + rise * rise))


@device_function(divides_by_zero=True, in_lanes=True)
def mesh_for(meshes: Meshes, mesh: int, radius: float, box: Float64, pose: Float64) -> tuple[int, float, float]:
    """Return the mesh to draw of a box that is seen under a radius [pixels], and cosine and sine of its heading."""
    x, y, z = box[0] - pose[EYE], box[1] - pose[EYE + 1], box[2] + 0.5 * box[6] - pose[EYE + 2]
    flat = math.sqrt(x * x + y * y)
    while radius < meshes.ranges[mesh, COARSER_BELOW]:
        coarser = meshes.ranges[mesh, COARSER]
        if meshes.ranges[coarser, IS_ONE_SIDED] and abs(z) > STEEP_VIEW * flat:
            break
        mesh = coarser
    if meshes.ranges[mesh, IS_ONE_SIDED]:
        per = 1.0 / larger(flat, 1e-6)
        return mesh, x * per, y * per
    return mesh, math.cos(box[3]), math.sin(box[3])


@device_function(divides_by_zero=True, in_lanes=True)
def write_normal(vertices: Float64, a: int, b: int, c: int, colors: Float32) -> None:
    """Write the normal of a triangle into the last columns of ``colors`` (12,)."""
    xs, ys, zs = vertices[AWAY], vertices[AWAY + 1], vertices[AWAY + 2]
    ux, uy, uz = xs[b] - xs[a], ys[b] - ys[a], zs[b] - zs[a]
    vx, vy, vz = xs[c] - xs[a], ys[c] - ys[a], zs[c] - zs[a]
    nx, ny, nz = uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx
    unit = 1.0 / math.sqrt(nx * nx + ny * ny + nz * nz + 1e-30)
    colors[9], colors[10], colors[11] = nx * unit, ny * unit, nz * unit


@device_function(forceinline=True, divides_by_zero=True, in_lanes=True)
def add_mesh(
    meshes: Meshes, mesh: int, paint: int, glow: int, row: int, semantic: int, lens: Float64,
    rings: Float64, width: int, height: int, light: Float64, scratch: FrameMemory, num_triangles: int, is_colored: bool,
    has_normals: bool, is_flat: bool,
) -> int:  # fmt: skip
    """Add the triangles of a mesh whose vertices are placed; return the new number of triangles.

    Args:
        meshes, mesh: The mesh.
        paint: Colour of ``BODY``.
        glow: Material that shines, or -1.
        row, semantic: Labels.
        lens, rings, width, height, light: Of the camera.
        scratch, num_triangles: Triangles so far.
        is_colored, has_normals: Whether colours and normals are needed.
        is_flat: Whether a triangle has one colour.
    """
    first, vertices = meshes.ranges[mesh, VERTEX_FIRST], scratch.vertices
    for t in range(meshes.ranges[mesh, TRIANGLE_FIRST], meshes.ranges[mesh, TRIANGLE_END]):
        if num_triangles >= len(scratch.labels):
            return num_triangles
        a, b, c = meshes.corners[t, 0] - first, meshes.corners[t, 1] - first, meshes.corners[t, 2] - first
        found = add_triangle(
            vertices, a, b, c, lens, rings, width, height, scratch.edges[num_triangles], scratch.spans[num_triangles],
            scratch.bounds[num_triangles],
        )  # fmt: skip
        if found == 0:
            continue
        material = meshes.material[t]
        labels, colors = scratch.labels[num_triangles], scratch.colors[num_triangles]
        labels[INSTANCE_ROW], labels[SEMANTIC], labels[MATERIAL] = row, semantic, material
        num_triangles += 1
        if has_normals or material == FACADE:
            write_normal(vertices, a, b, c, colors)
        if is_colored:
            color_triangle(
                meshes, material, paint, glow, is_flat or found == 1, light, vertices, scratch.lights, (a, b, c), colors
            )
    return num_triangles


@device_function(forceinline=True, divides_by_zero=True, in_lanes=True)
def add_instance(
    meshes: Meshes, mesh: int, paint: int, glow: int, row: int, semantic: int, box: Float64, spin: float,
    steer: float, pose: Float64, lens: Float64, rings: Float64, width: int, height: int, radius: float,
    light: Float64, scratch: FrameMemory, count: tuple[int, int], is_colored: bool, has_normals: bool,
) -> tuple[int, int]:  # fmt: skip
    """Add an object that is seen under a radius [pixels]; return the new numbers of triangles and instances."""
    num_triangles, num_instances = count
    if num_instances >= len(scratch.instances):
        return count
    mesh, cos, sin = mesh_for(meshes, mesh, radius, box, pose)
    if may_be_outline(meshes, mesh, lens) and num_triangles < len(scratch.labels):
        outline = meshes.outlines[mesh]
        ends = ends_of(outline, box, pose, lens)
        if is_upright(ends):
            bounds, labels = scratch.bounds[num_triangles], scratch.labels[num_triangles]
            spans, colors = scratch.spans[num_triangles], scratch.colors[num_triangles]
            if not add_outline(outline, ends, (cos, sin), box, pose, lens, width, height, spans, bounds):
                return count
            material = int(meshes.material[meshes.ranges[mesh, TRIANGLE_FIRST]])
            labels[INSTANCE_ROW], labels[SEMANTIC], labels[MATERIAL] = row, semantic, material
            color_outline(meshes.colors[color_of(material, paint)], box, pose, light, colors)
            list_instance(num_triangles, num_triangles + 1, int(bounds[1]), int(bounds[3]), 1, scratch, num_instances)
            return num_triangles + 1, num_instances + 1
    num_vertices = place_vertices(
        meshes, mesh, box, (cos, sin), spin, steer, pose, lens, scratch.vertices, scratch.lights
    )
    if is_colored:
        light_vertices(
            light, (cos, sin), num_vertices, meshes.ranges[mesh, IS_GLOSSY] > 0, scratch.vertices, scratch.lights
        )
    after = add_mesh(
        meshes, mesh, paint, glow, row, semantic, lens, rings, width, height, light, scratch, num_triangles,
        is_colored, has_normals, radius < SMALL,
    )  # fmt: skip
    if after == num_triangles:
        return count
    top, bottom = height, 0
    for t in range(num_triangles, after):
        top, bottom = smaller(top, int(scratch.bounds[t, 1])), larger(bottom, int(scratch.bounds[t, 3]))
    list_instance(num_triangles, after, top, bottom, 0, scratch, num_instances)
    return after, num_instances + 1


@device_function(forceinline=True, in_lanes=True)
def list_instance(
    first: int, end: int, top: int, bottom: int, is_outline: int, scratch: FrameMemory, place: int
) -> None:
    """Write the row of an instance in view."""
    instance = scratch.instances[place]
    instance[TRI_FIRST], instance[TRI_END], instance[TOP], instance[BOTTOM] = first, end, top, bottom
    instance[IS_OUTLINE] = is_outline


@device_function(forceinline=True, divides_by_zero=True)
def may_be_outline(meshes: Meshes, mesh: int, lens: Float64) -> bool:
    """Whether an outline stands for a mesh."""
    return bool(lens[KIND] == PINHOLE and meshes.outlines[mesh, WIDE] > 0.0)
