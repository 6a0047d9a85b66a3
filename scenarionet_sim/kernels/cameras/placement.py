"""Meshes in view: their vertices before the camera, and their triangles with the light on their corners."""

from __future__ import annotations

import math

from scenarionet_data.arrays.compiled import device_function
from scenarionet_data.arrays.dtypes import Float32, Float64
from scenarionet_sim.kernels.cameras.layout import (
    BODY,
    BOTTOM,
    CX,
    CY,
    DOWN,
    EYE,
    FACADE,
    FORWARD,
    FX,
    FY,
    HEADLAMP,
    INSTANCE_ROW,
    IS_FLAT,
    KIND,
    LAMP_GREEN,
    LAMP_RED,
    LAMPS,
    LEFT,
    MATERIAL,
    PINHOLE,
    RIGHT,
    RIGHT_END,
    SEMANTIC,
    TAIL_LAMP,
    TOP,
    TRI_END,
    TRI_FIRST,
    FrameMemory,
    Meshes,
)
from scenarionet_sim.kernels.cameras.lighting import lit
from scenarionet_sim.kernels.cameras.triangles import add_triangle, project_vertex
from scenarionet_sim.kernels.minmax import larger, smaller

NUM_MATERIALS = 21
SMALL = 24.0
"""Radius on the screen [pixels] below which the mesh for small pictures is drawn, with the same light everywhere on a
triangle."""

TINY = 6.0
"""Radius below which the mesh for tiny pictures is drawn."""


@device_function(forceinline=True, divides_by_zero=True)
def screen_radius(box: Float64, pose: Float64, lens: Float64, width: int, height: int, reach: float) -> float:
    """Return the radius [pixels] of the ball around a box on the screen; -1 if no pixel can show it."""
    radius = 0.5 * math.sqrt(box[4] ** 2 + box[5] ** 2 + box[6] ** 2) + 0.1
    wx, wy, wz = box[0] - pose[EYE], box[1] - pose[EYE + 1], box[2] + 0.5 * box[6] - pose[EYE + 2]
    far = math.sqrt(wx * wx + wy * wy + wz * wz)
    if not far - radius <= reach:  # not a number either
        return -1.0
    if lens[KIND] == PINHOLE:
        x = pose[RIGHT] * wx + pose[RIGHT + 1] * wy + pose[RIGHT + 2] * wz
        y = pose[DOWN] * wx + pose[DOWN + 1] * wy + pose[DOWN + 2] * wz
        z = pose[FORWARD] * wx + pose[FORWARD + 1] * wy + pose[FORWARD + 2] * wz
        side = larger(lens[CX], width - lens[CX]) / lens[FX]
        rise = larger(lens[CY], height - lens[CY]) / lens[FY]
        if z < -radius:
            return -1.0
        if abs(x) - z * side > radius * math.sqrt(1.0 + side * side):
            return -1.0
        if abs(y) - z * rise > radius * math.sqrt(1.0 + rise * rise):
            return -1.0
    return float(lens[FX] * radius / larger(far, 0.1))


@device_function(forceinline=True, divides_by_zero=True)
def mesh_for(meshes: Meshes, mesh: int, radius: float) -> int:
    """Return the mesh to draw of an object that is seen under a radius [pixels]."""
    if radius < TINY:
        return int(meshes.ranges[mesh, 5])
    return int(meshes.ranges[mesh, 4]) if radius < SMALL else mesh


@device_function(forceinline=True, divides_by_zero=True)
def place_vertex(
    meshes: Meshes, mesh: int, number: int, box: Float64, turn: tuple[float, float], spin: float, steer: float,
    pose: Float64, lens: Float64, vertex: Float64,
) -> None:  # fmt: skip
    """Write a vertex (12,) of a mesh in view.

    Args:
        meshes, mesh, number: The vertex of the mesh.
        box: (7,) x, y, z, heading, length, width, height.
        turn: Cosine and sine of the heading.
        spin, steer: Of the wheels, see ``instances.wheels_of``.
        pose, lens: The camera.
        vertex: (12,) see ``FrameMemory.vertices``.
    """
    cos, sin = turn
    source = meshes.vertices[number]
    sx, sy, sz = box[4], box[5], box[6]
    x, y, z = source[0] * sx, source[1] * sy, source[2] * sz
    nx, ny, nz = source[3] / sx, source[4] / sy, source[5] / sz
    part = meshes.part[number]
    if part > 0:
        wheel = meshes.wheels[mesh, part - 1]
        cx, cy, cz, radius = wheel[0] * sx, wheel[1] * sy, wheel[2] * sz, wheel[4] * sz
        angle = spin / larger(radius, 0.05)
        c, s = math.cos(angle), math.sin(angle)
        dx, dz = (x - cx) / larger(sx * wheel[3], 1e-3), (z - cz) / larger(radius, 1e-3)
        x, z = cx + radius * (c * dx + s * dz), cz + radius * (c * dz - s * dx)
        nx, nz = c * nx + s * nz, c * nz - s * nx
        if part <= 2:
            c, s = math.cos(steer), math.sin(steer)
            dx, dy = x - cx, y - cy
            x, y = cx + c * dx - s * dy, cy + s * dx + c * dy
            nx, ny = c * nx - s * ny, s * nx + c * ny
    unit = 1.0 / math.sqrt(nx * nx + ny * ny + nz * nz + 1e-30)
    vertex[3], vertex[4], vertex[5] = (cos * nx - sin * ny) * unit, (sin * nx + cos * ny) * unit, nz * unit
    wx = box[0] + cos * x - sin * y - pose[EYE]
    wy = box[1] + sin * x + cos * y - pose[EYE + 1]
    wz = box[2] + z - pose[EYE + 2]
    vertex[6], vertex[7], vertex[8] = wx, wy, wz
    vertex[0] = pose[RIGHT] * wx + pose[RIGHT + 1] * wy + pose[RIGHT + 2] * wz
    vertex[1] = pose[DOWN] * wx + pose[DOWN + 1] * wy + pose[DOWN + 2] * wz
    vertex[2] = pose[FORWARD] * wx + pose[FORWARD + 1] * wy + pose[FORWARD + 2] * wz
    project_vertex(lens, vertex)


@device_function(forceinline=True, divides_by_zero=True)
def color_triangle(
    meshes: Meshes, material: int, paint: int, glow: int, is_flat: bool, light: Float64, vertices: Float64,
    corners: tuple[int, int, int], colors: Float32,
) -> None:  # fmt: skip
    """Write the light on the corners of a triangle, or on the first one only, into ``colors`` (12,)."""
    color = meshes.colors[NUM_MATERIALS + paint if material in (BODY, FACADE) else material]
    strength = 0.0
    if material == TAIL_LAMP and glow == TAIL_LAMP:
        strength = 5.0
    elif material in (HEADLAMP, TAIL_LAMP):
        strength = light[LAMPS] * (3.0 if material == HEADLAMP else 1.2)
    elif LAMP_RED <= material <= LAMP_GREEN:
        strength = 6.0 if glow == material else -0.85
    faint, extra = 1.0 + smaller(strength, 0.0), larger(strength, 0.0)
    for corner in range(1 if is_flat else 3):
        vertex = vertices[corners[0] if corner == 0 else (corners[1] if corner == 1 else corners[2])]
        red, green, blue = lit(light, material, color[0], color[1], color[2], vertex)
        colors[3 * corner] = larger(red * faint + extra * color[0], 0.0)
        colors[3 * corner + 1] = larger(green * faint + extra * color[1], 0.0)
        colors[3 * corner + 2] = larger(blue * faint + extra * color[2], 0.0)


@device_function(forceinline=True, divides_by_zero=True)
def write_normal(vertices: Float64, a: int, b: int, c: int, colors: Float32) -> None:
    """Write the normal of a triangle into the last columns of ``colors`` (12,)."""
    pa, pb, pc = vertices[a], vertices[b], vertices[c]
    ux, uy, uz = pb[6] - pa[6], pb[7] - pa[7], pb[8] - pa[8]
    vx, vy, vz = pc[6] - pa[6], pc[7] - pa[7], pc[8] - pa[8]
    nx, ny, nz = uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx
    unit = 1.0 / math.sqrt(nx * nx + ny * ny + nz * nz + 1e-30)
    colors[9], colors[10], colors[11] = nx * unit, ny * unit, nz * unit


@device_function(forceinline=True, divides_by_zero=True)
def add_mesh(
    meshes: Meshes, mesh: int, paint: int, glow: int, row: int, semantic: int, lens: Float64,
    rings: Float64, width: int, height: int, light: Float64, scratch: FrameMemory, num_triangles: int, is_colored: bool,
    is_flat: bool,
) -> int:  # fmt: skip
    """Add the triangles of a mesh whose vertices are placed; return the new number of triangles.

    Args:
        meshes, mesh: The mesh.
        paint: Colour of ``BODY``.
        glow: Material that shines, or -1.
        row, semantic: Labels.
        lens, rings, width, height, light: Of the camera.
        scratch, num_triangles: Triangles so far.
        is_colored: Whether colours are needed.
        is_flat: Whether a triangle has one colour.
    """
    first, vertices = meshes.ranges[mesh, 0], scratch.vertices
    for t in range(meshes.ranges[mesh, 2], meshes.ranges[mesh, 3]):
        if num_triangles >= len(scratch.labels):
            return num_triangles
        a, b, c = meshes.corners[t, 0] - first, meshes.corners[t, 1] - first, meshes.corners[t, 2] - first
        if not add_triangle(
            vertices, a, b, c, lens, rings, width, height, scratch.edges[num_triangles], scratch.spans[num_triangles],
            scratch.bounds[num_triangles],
        ):  # fmt: skip
            continue
        material = meshes.material[t]
        labels, colors = scratch.labels[num_triangles], scratch.colors[num_triangles]
        labels[INSTANCE_ROW], labels[SEMANTIC], labels[MATERIAL] = row, semantic, material
        labels[IS_FLAT] = 1 if is_flat else 0
        write_normal(vertices, a, b, c, colors)
        num_triangles += 1
        if is_colored:
            color_triangle(meshes, material, paint, glow, is_flat, light, vertices, (a, b, c), colors)
    return num_triangles


@device_function(forceinline=True, divides_by_zero=True)
def add_instance(
    meshes: Meshes, mesh: int, paint: int, glow: int, row: int, semantic: int, box: Float64, spin: float,
    steer: float, pose: Float64, lens: Float64, rings: Float64, width: int, height: int, radius: float,
    light: Float64, scratch: FrameMemory, count: tuple[int, int], is_colored: bool,
) -> tuple[int, int]:  # fmt: skip
    """Add an object that is seen under a radius [pixels]; return the new numbers of triangles and instances."""
    num_triangles, num_instances = count
    if num_instances >= len(scratch.instances):
        return count
    mesh = mesh_for(meshes, mesh, radius)
    turn, first = (math.cos(box[3]), math.sin(box[3])), meshes.ranges[mesh, 0]
    for number in range(first, meshes.ranges[mesh, 1]):
        place_vertex(meshes, mesh, number, box, turn, spin, steer, pose, lens, scratch.vertices[number - first])
    after = add_mesh(
        meshes, mesh, paint, glow, row, semantic, lens, rings, width, height, light, scratch, num_triangles,
        is_colored, radius < SMALL,
    )  # fmt: skip
    if after == num_triangles:
        return count
    instance = scratch.instances[num_instances]
    instance[TRI_FIRST], instance[TRI_END] = num_triangles, after
    left, top, right, bottom = width * 2, height, -width, 0
    for t in range(num_triangles, after):
        left, top = smaller(left, scratch.bounds[t, 0]), smaller(top, scratch.bounds[t, 1])
        right, bottom = larger(right, scratch.bounds[t, 2]), larger(bottom, scratch.bounds[t, 3])
    instance[LEFT], instance[TOP], instance[RIGHT_END], instance[BOTTOM] = left, top, right, bottom
    return after, num_instances + 1
