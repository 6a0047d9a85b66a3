"""The light on the vertices of meshes, and of triangles."""

from __future__ import annotations

import math

from scenarionet_data.arrays.dtypes import Float32, Float64
from scenarionet_data.compiled.decorators import device_function
from scenarionet_sim.arrays.minmax import larger, smaller
from scenarionet_sim.cameras.draw import codes
from scenarionet_sim.cameras.draw import columns as at
from scenarionet_sim.cameras.draw.single_precision import single, singles
from scenarionet_sim.cameras.draw.structures import FrameView, Item, Meshes, Places, Triple, Vertices
from scenarionet_sim.cameras.draw.vertices import turn_normals

NUM_MATERIALS = 21

Three = tuple[float, float, float]
"""A direction, or linear RGB."""

LEAST_AREA = 0.5
"""Twice the area [pixels] of triangles below which their light is the same everywhere."""


@device_function(divides_by_zero=True, in_lanes=True)
def light_vertices(
    view: FrameView, item: Item, count: int, is_glossy: bool, vertices: Float64, lights: Float32
) -> None:
    """Write the light on the first vertices of a mesh in view.

    At night the light of lamps comes from above and behind the camera.

    Args:
        view, item: The camera, and what the mesh stands for.
        count: Number of vertices.
        is_glossy: Whether a material of the mesh mirrors.
        vertices, lights: See ``FrameMemory``.
    """
    nx, ny, nz = lights[at.NORMAL], lights[at.NORMAL + 1], lights[at.NORMAL + 2]
    light, pose = view.light, view.pose
    turn_normals(count, single(item.turn[0]), single(item.turn[1]), nx, ny, nz)
    to_sun = singles(light, at.SUN)
    if light[at.NIGHT] > 0.0:
        to_sun = single(-0.8 * pose[at.FORWARD]), single(-0.8 * pose[at.FORWARD + 1]), single(0.6)
    red, green, blue = light[at.SUNLIGHT], light[at.SUNLIGHT + 1], light[at.SUNLIGHT + 2]
    sunlight = single(red * item.lit), single(green * item.lit), single(blue * item.lit)
    diffuse = lights[at.DIFFUSE], lights[at.DIFFUSE + 1], lights[at.DIFFUSE + 2]
    _light_vertices(count, light, to_sun, sunlight, (nx, ny, nz), diffuse)
    if is_glossy:
        away = vertices[at.AWAY], vertices[at.AWAY + 1], vertices[at.AWAY + 2]
        mirror = lights[at.MIRROR], lights[at.MIRROR + 1], lights[at.MIRROR + 2]
        gloss = lights[at.GLOSS], lights[at.GLOSS + 1], lights[at.GLOSS + 2]
        _mirror(count, light, to_sun, sunlight, away, (nx, ny, nz), mirror, gloss)


@device_function(divides_by_zero=True, in_lanes=True)
def _light_vertices(
    count: int, light: Float64, to_sun: Three, sunlight: Three, normals: Triple, diffuse: Triple
) -> None:
    """Write the light of sun, sky and ground that arrives (Lambert)."""
    nx, ny, nz = normals
    red, green, blue = diffuse
    (sx, sy, sz), (sun_r, sun_g, sun_b) = to_sun, sunlight
    sky_r, sky_g, sky_b = singles(light, at.SKYLIGHT)
    low_r, low_g, low_b = singles(light, at.BOUNCE)
    for k in range(count):
        x, y, z = nx[k], ny[k], nz[k]
        above, direct = 0.5 + 0.5 * z, larger(x * sx + y * sy + z * sz, 0.0)
        below = 1.0 - above
        red[k] = sun_r * direct + sky_r * above + low_r * below
        green[k] = sun_g * direct + sky_g * above + low_g * below
        blue[k] = sun_b * direct + sky_b * above + low_b * below


@device_function(divides_by_zero=True, in_lanes=True)
def _mirror(
    count: int, light: Float64, to_sun: Three, sunlight: Three, away: Places, normals: Triple, mirror: Triple,
    gloss: Triple,
) -> None:  # fmt: skip
    """Write what is mirrored towards the camera, and the part that depends on the angle of view, with the highlight.

    Sky or ground is mirrored; its share grows with the angle (Schlick).
    """
    away_x, away_y, away_z = away
    nx, ny, nz = normals
    mirror_r, mirror_g, mirror_b = mirror
    gloss_r, gloss_g, gloss_b = gloss
    (sx, sy, sz), (sun_r, sun_g, sun_b) = to_sun, sunlight
    low_r, low_g, low_b = singles(light, at.HORIZON)
    high_r, high_g, high_b = singles(light, at.ZENITH)
    to_r, to_g, to_b = high_r - low_r, high_g - low_g, high_b - low_b
    ground_r, ground_g, ground_b = singles(light, at.BOUNCE)
    ground_r, ground_g, ground_b = 0.22 * ground_r, 0.22 * ground_g, 0.22 * ground_b
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
        gloss_r[k], gloss_g[k] = share * r + shine * sun_r, share * g + shine * sun_g
        gloss_b[k] = share * b + shine * sun_b


@device_function(forceinline=True, divides_by_zero=True, in_lanes=True)
def color_triangle(
    corners: tuple[int, int, int], material: int, is_flat: bool, item: Item, light: Float64, meshes: Meshes,
    vertices: Vertices, colors: Float32,
) -> None:  # fmt: skip
    """Write the light of a triangle, the same everywhere or a plane through that at its corners, to ``colors`` (12,).

    Args:
        corners: Vertices.
        material: Material.
        is_flat: Whether the light is the same everywhere; it must be if a corner has no place on the screen.
        item: What it is part of.
        light: Light of the frame.
        meshes, vertices, colors: See ``structures``.
    """
    color = meshes.colors[color_of(material, item.paint)]
    strength, lights = strength_of(material, item.glow, light), vertices.lights
    a, b, c = corners
    columns, rows = vertices.places[at.COLUMN], vertices.places[at.ROW]
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
    return NUM_MATERIALS + paint if material in (codes.BODY, codes.FACADE) else material


@device_function(divides_by_zero=True)
def strength_of(material: int, glow: int, light: Float64) -> float:
    """Return how brightly a material shines by itself, or that it is darker (below 0), by the material that glows."""
    if material == codes.TAIL_LAMP and glow == codes.TAIL_LAMP:
        return 5.0
    if material in (codes.HEADLAMP, codes.TAIL_LAMP):
        return float(light[at.LAMPS] * (3.0 if material == codes.HEADLAMP else 1.2))
    if codes.LAMP_RED <= material <= codes.LAMP_GREEN:
        return 6.0 if glow == material else -0.94
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
    sent = color * lights[at.DIFFUSE + channel, corner]
    if material in (codes.BODY, codes.GLASS, codes.METAL):
        share = 0.10 if material == codes.GLASS else 0.045
        sent += share * lights[at.MIRROR + channel, corner] + lights[at.GLOSS + channel, corner]
    return float(larger(sent * (1.0 + smaller(strength, 0.0)) + larger(strength, 0.0) * color, 0.0))
