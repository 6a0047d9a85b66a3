"""The light on the vertices of meshes, and of triangles."""

from __future__ import annotations

import math

from scenarionet_data.arrays.dtypes import Float32, Float64
from scenarionet_data.compiled.decorators import device_function
from scenarionet_sim.arrays.minmax import larger, smaller
from scenarionet_sim.cameras.draw.layout import (
    AWAY,
    BODY,
    BOUNCE,
    COLUMN,
    DIFFUSE,
    FACADE,
    GLASS,
    GLOSS,
    HEADLAMP,
    HORIZON,
    LAMP_GREEN,
    LAMP_RED,
    LAMPS,
    METAL,
    MIRROR,
    NORMAL,
    ROW,
    SKYLIGHT,
    SUN,
    SUNLIGHT,
    TAIL_LAMP,
    ZENITH,
    Meshes,
)
from scenarionet_sim.cameras.draw.singles import single
from scenarionet_sim.cameras.draw.vertices import turn_normals

NUM_MATERIALS = 21

LEAST_AREA = 0.5
"""Twice the area [pixels] of triangles below which their light is the same everywhere."""


@device_function(divides_by_zero=True, in_lanes=True)
def light_vertices(
    light: Float64, turn: tuple[float, float], count: int, is_glossy: bool, vertices: Float64, lights: Float32
) -> None:
    """Write the light on the first vertices of a mesh in view.

    Args:
        light: Light of the frame.
        turn: Cosine and sine of the heading of the mesh.
        count: Number of vertices.
        is_glossy: Whether a material of the mesh mirrors.
        vertices, lights: See ``FrameMemory``.
    """
    nx, ny, nz = lights[NORMAL], lights[NORMAL + 1], lights[NORMAL + 2]
    turn_normals(count, single(turn[0]), single(turn[1]), nx, ny, nz)
    _light_vertices(count, light, nx, ny, nz, lights[DIFFUSE], lights[DIFFUSE + 1], lights[DIFFUSE + 2])
    if is_glossy:
        _mirror(
            count, light, vertices[AWAY], vertices[AWAY + 1], vertices[AWAY + 2], nx, ny, nz, lights[MIRROR],
            lights[MIRROR + 1], lights[MIRROR + 2], lights[GLOSS], lights[GLOSS + 1], lights[GLOSS + 2],
        )  # fmt: skip


@device_function(divides_by_zero=True, in_lanes=True)
def _light_vertices(
    count: int, light: Float64, nx: Float32, ny: Float32, nz: Float32, red: Float32, green: Float32, blue: Float32
) -> None:
    """Write the light of sun, sky and ground that arrives (Lambert)."""
    sx, sy, sz = single(light[SUN]), single(light[SUN + 1]), single(light[SUN + 2])
    sun_r, sun_g, sun_b = (
        single(light[SUNLIGHT]), single(light[SUNLIGHT + 1]), single(light[SUNLIGHT + 2])
    )  # fmt: skip
    sky_r, sky_g, sky_b = (
        single(light[SKYLIGHT]), single(light[SKYLIGHT + 1]), single(light[SKYLIGHT + 2])
    )  # fmt: skip
    low_r, low_g, low_b = single(light[BOUNCE]), single(light[BOUNCE + 1]), single(light[BOUNCE + 2])
    for k in range(count):
        x, y, z = nx[k], ny[k], nz[k]
        above, direct = 0.5 + 0.5 * z, larger(x * sx + y * sy + z * sz, 0.0)
        below = 1.0 - above
        red[k] = sun_r * direct + sky_r * above + low_r * below
        green[k] = sun_g * direct + sky_g * above + low_g * below
        blue[k] = sun_b * direct + sky_b * above + low_b * below


@device_function(divides_by_zero=True, in_lanes=True)
def _mirror(
    count: int, light: Float64, away_x: Float64, away_y: Float64, away_z: Float64, nx: Float32, ny: Float32,
    nz: Float32, mirror_r: Float32, mirror_g: Float32, mirror_b: Float32, gloss_r: Float32, gloss_g: Float32,
    gloss_b: Float32,
) -> None:  # fmt: skip
    """Write what is mirrored towards the camera, and the part that depends on the angle of view, with the highlight.

    Sky or ground is mirrored; its share grows with the angle (Schlick).
    """
    sx, sy, sz = single(light[SUN]), single(light[SUN + 1]), single(light[SUN + 2])
    sun_r, sun_g, sun_b = (
        single(light[SUNLIGHT]), single(light[SUNLIGHT + 1]), single(light[SUNLIGHT + 2])
    )  # fmt: skip
    low_r, low_g, low_b = single(light[HORIZON]), single(light[HORIZON + 1]), single(light[HORIZON + 2])
    to_r = single(light[ZENITH]) - low_r
    to_g = single(light[ZENITH + 1]) - low_g
    to_b = single(light[ZENITH + 2]) - low_b
    ground_r, ground_g, ground_b = (
        0.22 * single(light[BOUNCE]), 0.22 * single(light[BOUNCE + 1]), 0.22 * single(light[BOUNCE + 2])
    )  # fmt: skip
    for k in range(count):
        x, y, z = nx[k], ny[k], nz[k]
        vx, vy, vz = single(away_x[k]), single(away_y[k]), single(away_z[k])
        per = 1.0 / math.sqrt(vx * vx + vy * vy + vz * vz + 1e-9)
        vx, vy, vz = vx * per, vy * per, vz * per
        toward = smaller(larger(-(x * vx + y * vy + z * vz), 0.0), 1.0)
        rest = 1.0 - toward
        share = 0.7 * rest * rest * rest * rest * rest
        rx, ry, rz = vx + 2.0 * toward * x, vy + 2.0 * toward * y, vz + 2.0 * toward * z
        root = math.sqrt(larger(rz, 0.0))
        rise, is_sky = root * (1.6 - 0.6 * root), rz > 0.0  # as ``sky_gradient``
        r = low_r + to_r * rise if is_sky else ground_r
        g = low_g + to_g * rise if is_sky else ground_g
        b = low_b + to_b * rise if is_sky else ground_b
        shine = larger(rx * sx + ry * sy + rz * sz, 0.0)
        shine *= shine
        shine *= shine
        shine *= shine
        shine *= shine
        shine = 0.35 * shine * shine
        mirror_r[k], mirror_g[k], mirror_b[k] = r, g, b
        gloss_r[k], gloss_g[k], gloss_b[k] = (
            share * r + shine * sun_r,
            share * g + shine * sun_g,
            share * b + shine * sun_b,
        )


@device_function(forceinline=True, divides_by_zero=True, in_lanes=True)
def color_triangle(
    meshes: Meshes, material: int, paint: int, glow: int, is_flat: bool, light: Float64, vertices: Float64,
    lights: Float32, corners: tuple[int, int, int], colors: Float32,
) -> None:  # fmt: skip
    """Write the light of a triangle, the same everywhere or a plane through that at its corners, to ``colors`` (12,).

    Args:
        meshes: Colours.
        material: Material.
        paint: Colour of ``BODY``.
        glow: Material that shines, or -1.
        is_flat: Whether the light is the same everywhere; it must be if a corner has no place on the screen.
        light: Light of the frame.
        vertices, lights: See ``FrameMemory``.
        corners: Vertices.
        colors: See ``FrameMemory``.
    """
    color = meshes.colors[color_of(material, paint)]
    strength = strength_of(material, glow, light)
    a, b, c = corners
    columns, rows = vertices[COLUMN], vertices[ROW]
    ux, uy, vx, vy = columns[b] - columns[a], rows[b] - rows[a], columns[c] - columns[a], rows[c] - rows[a]
    area = ux * vy - vx * uy
    is_flat = is_flat or abs(area) < LEAST_AREA
    per_area = 0.0 if is_flat else 1.0 / area
    for channel in range(3):
        albedo, along, down = color[channel] * 1.0, 0.0, 0.0
        start = corner_light(material, albedo, strength, lights, a, channel)
        if not is_flat:
            to_b = corner_light(material, albedo, strength, lights, b, channel) - start
            to_c = corner_light(material, albedo, strength, lights, c, channel) - start
            along, down = (to_b * vy - to_c * uy) * per_area, (to_c * ux - to_b * vx) * per_area
            start -= along * (columns[a] - 0.5) + down * (rows[a] - 0.5)
        colors[3 * channel], colors[3 * channel + 1], colors[3 * channel + 2] = start, along, down


@device_function(forceinline=True, divides_by_zero=True)
def color_of(material: int, paint: int) -> int:
    """Return the row of ``Meshes.colors`` of a material of an instance."""
    return NUM_MATERIALS + paint if material in (BODY, FACADE) else material


@device_function(divides_by_zero=True)
def strength_of(material: int, glow: int, light: Float64) -> float:
    """Return how brightly a material shines by itself, or that it is darker (below 0), by the material that glows."""
    if material == TAIL_LAMP and glow == TAIL_LAMP:
        return 5.0
    if material in (HEADLAMP, TAIL_LAMP):
        return float(light[LAMPS] * (3.0 if material == HEADLAMP else 1.2))
    if LAMP_RED <= material <= LAMP_GREEN:
        return 6.0 if glow == material else -0.85
    return 0.0


@device_function(forceinline=True, divides_by_zero=True, in_lanes=True)
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
