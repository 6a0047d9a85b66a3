"""Meshes in view: their vertices before the camera, and their triangles with the light on their corners."""

from __future__ import annotations

import math

from scenarionet_data.arrays.compiled import device_function
from scenarionet_data.arrays.dtypes import Float32, Float64, Int32, UInt8
from scenarionet_sim.kernels.cameras.layout import (
    AWAY,
    BODY,
    BOTTOM,
    COLUMN,
    CX,
    CY,
    DIFFUSE,
    DOWN,
    EYE,
    FACADE,
    FORWARD,
    FX,
    FY,
    GLASS,
    GLOSS,
    HEADLAMP,
    INSTANCE_ROW,
    KIND,
    LAMP_GREEN,
    LAMP_RED,
    LAMPS,
    MATERIAL,
    METAL,
    MIRROR,
    NORMAL,
    PINHOLE,
    RIGHT,
    ROW,
    SEMANTIC,
    TAIL_LAMP,
    TOP,
    TRI_END,
    TRI_FIRST,
    VIEW,
    FrameMemory,
    Meshes,
)
from scenarionet_sim.kernels.cameras.lighting import light_vertices
from scenarionet_sim.kernels.cameras.triangles import add_triangle, project_vertices
from scenarionet_sim.kernels.minmax import larger, smaller

NUM_MATERIALS = 21
SMALL = 24.0
"""Radius on the screen [pixels] below which the mesh for small pictures is drawn, with the same light everywhere on a
triangle."""

TINY = 6.0
"""Radius below which the mesh for tiny pictures is drawn."""

LEAST_AREA = 0.5
"""Twice the area [pixels] of triangles below which their light is the same everywhere."""


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


@device_function(divides_by_zero=True)
def mesh_for(meshes: Meshes, mesh: int, radius: float) -> int:
    """Return the mesh to draw of an object that is seen under a radius [pixels]."""
    if radius < TINY:
        return int(meshes.ranges[mesh, 5])
    return int(meshes.ranges[mesh, 4]) if radius < SMALL else mesh


@device_function(divides_by_zero=True)
def place_vertices(
    meshes: Meshes, mesh: int, first: int, end: int, box: Float64, spin: float, steer: float, pose: Float64,
    lens: Float64, vertices: Float64,
) -> None:  # fmt: skip
    """Write some vertices of a mesh in view, for ``box`` x, y, z, heading, length, width, height."""
    count, source = end - first, meshes.vertices
    xs, ys, zs = vertices[AWAY, :count], vertices[AWAY + 1, :count], vertices[AWAY + 2, :count]
    nx, ny, nz = vertices[NORMAL, :count], vertices[NORMAL + 1, :count], vertices[NORMAL + 2, :count]
    _scale(
        box, source[0, first:end], source[1, first:end], source[2, first:end], source[3, first:end],
        source[4, first:end], source[5, first:end], xs, ys, zs, nx, ny, nz,
    )  # fmt: skip
    if meshes.wheels[mesh, 0, 4] > 0.0:
        _turn_wheels(meshes.wheels[mesh], meshes.part[first:end], box, spin, steer, xs, ys, zs, nx, ny, nz)
    _turn(
        math.cos(box[3]), math.sin(box[3]), box[0] - pose[EYE], box[1] - pose[EYE + 1], box[2] - pose[EYE + 2],
        pose, xs, ys, zs, nx, ny, nz, vertices[VIEW, :count], vertices[VIEW + 1, :count], vertices[VIEW + 2, :count],
    )  # fmt: skip
    project_vertices(lens, count, vertices)


@device_function(divides_by_zero=True, in_lanes=True)
def _scale(
    box: Float64, from_x: Float32, from_y: Float32, from_z: Float32, from_nx: Float32, from_ny: Float32,
    from_nz: Float32, xs: Float64, ys: Float64, zs: Float64, nx: Float64, ny: Float64, nz: Float64,
) -> None:  # fmt: skip
    """Write vertices and normals of a mesh scaled to its box."""
    sx, sy, sz = box[4], box[5], box[6]
    per_x, per_y, per_z = 1.0 / sx, 1.0 / sy, 1.0 / sz
    for k in range(len(xs)):
        xs[k], ys[k], zs[k] = from_x[k] * sx, from_y[k] * sy, from_z[k] * sz
        nx[k], ny[k], nz[k] = from_nx[k] * per_x, from_ny[k] * per_y, from_nz[k] * per_z


@device_function(divides_by_zero=True)
def _turn_wheels(
    wheels: Float32, parts: UInt8, box: Float64, spin: float, steer: float, xs: Float64, ys: Float64, zs: Float64,
    nx: Float64, ny: Float64, nz: Float64,
) -> None:  # fmt: skip
    """Roll the vertices of wheels about their axles, and steer those of the front ones."""
    sx, sy, sz = box[4], box[5], box[6]
    cos, sin = math.cos(steer), math.sin(steer)
    before, radius, c, s = 0, 0.0, 1.0, 0.0
    for k in range(len(xs)):
        part = parts[k]
        if part == 0:
            continue
        wheel = wheels[part - 1]
        if part != before:
            before, radius = part, wheel[4] * sz
            angle = spin / larger(radius, 0.05)
            c, s = math.cos(angle), math.sin(angle)
        cx, cy, cz = wheel[0] * sx, wheel[1] * sy, wheel[2] * sz
        dx, dz = (xs[k] - cx) / larger(sx * wheel[3], 1e-3), (zs[k] - cz) / larger(radius, 1e-3)
        xs[k], zs[k] = cx + radius * (c * dx + s * dz), cz + radius * (c * dz - s * dx)
        nx[k], nz[k] = c * nx[k] + s * nz[k], c * nz[k] - s * nx[k]
        if part <= 2:
            dx, dy = xs[k] - cx, ys[k] - cy
            xs[k], ys[k] = cx + cos * dx - sin * dy, cy + sin * dx + cos * dy
            nx[k], ny[k] = cos * nx[k] - sin * ny[k], sin * nx[k] + cos * ny[k]


@device_function(divides_by_zero=True, in_lanes=True)
def _turn(
    cos: float, sin: float, x: float, y: float, z: float, pose: Float64, xs: Float64, ys: Float64, zs: Float64,
    nx: Float64, ny: Float64, nz: Float64, right: Float64, down: Float64, ahead: Float64,
) -> None:  # fmt: skip
    """Turn vertices and normals into the scenario's frame, move them to ``x``, ``y``, ``z`` from the camera, and write
    where they are in its frame.
    """
    rx, ry, rz = pose[RIGHT], pose[RIGHT + 1], pose[RIGHT + 2]
    dx, dy, dz = pose[DOWN], pose[DOWN + 1], pose[DOWN + 2]
    fx, fy, fz = pose[FORWARD], pose[FORWARD + 1], pose[FORWARD + 2]
    for k in range(len(xs)):
        ax, ay, az = x + cos * xs[k] - sin * ys[k], y + sin * xs[k] + cos * ys[k], z + zs[k]
        xs[k], ys[k], zs[k] = ax, ay, az
        right[k] = rx * ax + ry * ay + rz * az
        down[k] = dx * ax + dy * ay + dz * az
        ahead[k] = fx * ax + fy * ay + fz * az
        u, v, w = nx[k], ny[k], nz[k]
        unit = 1.0 / math.sqrt(u * u + v * v + w * w + 1e-30)
        nx[k], ny[k], nz[k] = (cos * u - sin * v) * unit, (sin * u + cos * v) * unit, w * unit


@device_function(divides_by_zero=True)
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
    for t in range(meshes.ranges[mesh, 2], meshes.ranges[mesh, 3]):
        if num_triangles >= len(scratch.labels):
            return num_triangles
        if write_triangle(
            meshes, mesh, t, paint, glow, row, semantic, lens, rings, width, height, light, is_colored, is_flat,
            scratch.vertices, scratch.lights, scratch.edges[num_triangles], scratch.spans[num_triangles],
            scratch.colors[num_triangles], scratch.labels[num_triangles], scratch.bounds[num_triangles],
        ):  # fmt: skip
            num_triangles += 1
    return num_triangles


@device_function(divides_by_zero=True)
def write_triangle(
    meshes: Meshes, mesh: int, number: int, paint: int, glow: int, row: int, semantic: int, lens: Float64,
    rings: Float64, width: int, height: int, light: Float64, is_colored: bool, is_flat: bool, vertices: Float64,
    lights: Float32, edges: Float64, spans: Float64, colors: Float32, labels: Int32, bounds: Int32,
) -> bool:  # fmt: skip
    """Write a triangle of a mesh whose vertices are placed and lit, if it may be in view.

    Args:
        number: Of the triangle in ``meshes``.
        vertices, lights: Of the mesh.
        edges, spans, colors, labels, bounds: Outputs, see ``FrameMemory``.
        meshes, mesh, paint, glow, row, semantic, lens, rings, width, height, light, is_colored, is_flat: See
            :func:`add_mesh`.
    """
    first = meshes.ranges[mesh, 0]
    a, b, c = meshes.corners[number, 0] - first, meshes.corners[number, 1] - first, meshes.corners[number, 2] - first
    found = add_triangle(vertices, a, b, c, lens, rings, width, height, edges, spans, bounds)
    if found == 0:
        return False
    material = meshes.material[number]
    labels[INSTANCE_ROW], labels[SEMANTIC], labels[MATERIAL] = row, semantic, material
    xs, ys, zs = vertices[AWAY], vertices[AWAY + 1], vertices[AWAY + 2]
    ux, uy, uz = xs[b] - xs[a], ys[b] - ys[a], zs[b] - zs[a]
    vx, vy, vz = xs[c] - xs[a], ys[c] - ys[a], zs[c] - zs[a]
    nx, ny, nz = uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx
    unit = 1.0 / math.sqrt(nx * nx + ny * ny + nz * nz + 1e-30)
    colors[9], colors[10], colors[11] = nx * unit, ny * unit, nz * unit
    if is_colored:
        color = meshes.colors[NUM_MATERIALS + paint if material in (BODY, FACADE) else material]
        strength = strength_of(material, glow, light)
        if is_flat or found == 1:
            _color_flat(material, color, strength, a, lights, colors)
        else:
            _color_corners(material, color, strength, a, b, c, vertices, lights, colors)
    return True


@device_function(divides_by_zero=True)
def strength_of(material: int, glow: int, light: Float64) -> float:
    """Return how brightly a material shines by itself, or that it is darker (below 0), by the material that glows."""
    if material == TAIL_LAMP and glow == TAIL_LAMP:
        return 5.0
    if material in (HEADLAMP, TAIL_LAMP):
        return light[LAMPS] * (3.0 if material == HEADLAMP else 1.2)
    if LAMP_RED <= material <= LAMP_GREEN:
        return 6.0 if glow == material else -0.85
    return 0.0


@device_function(forceinline=True, divides_by_zero=True)
def corner_light(material: int, color: float, strength: float, lights: Float32, corner: int, channel: int) -> float:
    """Return the light that a corner of a triangle sends to the camera, in one channel.

    Args:
        material, color: Material and its linear colour.
        strength: See :func:`strength_of`.
        lights: (NUM_LIGHTS, V) light on vertices, see ``FrameMemory.lights``.
        corner: Vertex.
        channel: 0 to 2.
    """
    sent = color * lights[DIFFUSE + channel, corner]
    if material in (BODY, GLASS, METAL):
        share = 0.10 if material == GLASS else 0.045
        sent += share * lights[MIRROR + channel, corner] + lights[GLOSS + channel, corner]
    return float(larger(sent * (1.0 + smaller(strength, 0.0)) + larger(strength, 0.0) * color, 0.0))


@device_function(divides_by_zero=True)
def _color_flat(material: int, color: Float32, strength: float, corner: int, lights: Float32, colors: Float32) -> None:
    """Give a triangle the light at one of its corners."""
    for channel in range(3):
        colors[3 * channel] = corner_light(material, color[channel] * 1.0, strength, lights, corner, channel)
        colors[3 * channel + 1] = colors[3 * channel + 2] = 0.0


@device_function(divides_by_zero=True)
def _color_corners(
    material: int, color: Float32, strength: float, a: int, b: int, c: int, vertices: Float64, lights: Float32,
    colors: Float32,
) -> None:  # fmt: skip
    """Write the plane over the screen through the light at the corners of a triangle, in each channel."""
    columns, rows = vertices[COLUMN], vertices[ROW]
    x, y = columns[a] - 0.5, rows[a] - 0.5
    ux, uy, vx, vy = columns[b] - columns[a], rows[b] - rows[a], columns[c] - columns[a], rows[c] - rows[a]
    area = ux * vy - vx * uy
    if abs(area) < LEAST_AREA:
        _color_flat(material, color, strength, a, lights, colors)
        return
    scale = 1.0 / area
    for channel in range(3):
        albedo = color[channel] * 1.0
        at_a = corner_light(material, albedo, strength, lights, a, channel)
        to_b = corner_light(material, albedo, strength, lights, b, channel) - at_a
        to_c = corner_light(material, albedo, strength, lights, c, channel) - at_a
        along, down = (to_b * vy - to_c * uy) * scale, (to_c * ux - to_b * vx) * scale
        colors[3 * channel] = at_a - along * x - down * y
        colors[3 * channel + 1], colors[3 * channel + 2] = along, down


@device_function(divides_by_zero=True)
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
    first, end = meshes.ranges[mesh, 0], meshes.ranges[mesh, 1]
    place_vertices(meshes, mesh, first, end, box, spin, steer, pose, lens, scratch.vertices)
    if is_colored:
        light_vertices(light, end - first, meshes.ranges[mesh, 6] > 0, scratch.vertices, scratch.lights)
    after = add_mesh(
        meshes, mesh, paint, glow, row, semantic, lens, rings, width, height, light, scratch, num_triangles,
        is_colored, radius < SMALL,
    )  # fmt: skip
    if after == num_triangles:
        return count
    top, bottom = height, 0
    for t in range(num_triangles, after):
        top, bottom = smaller(top, int(scratch.bounds[t, 1])), larger(bottom, int(scratch.bounds[t, 3]))
    instance = scratch.instances[num_instances]
    instance[TRI_FIRST], instance[TRI_END], instance[TOP], instance[BOTTOM] = num_triangles, after, top, bottom
    return after, num_instances + 1
