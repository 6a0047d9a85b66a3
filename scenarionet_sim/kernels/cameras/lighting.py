"""The light on the vertices of meshes."""

from __future__ import annotations

import math

from scenarionet_data.arrays.compiled import device_function
from scenarionet_data.arrays.dtypes import Float32, Float64
from scenarionet_sim.kernels.cameras.layout import (
    AWAY,
    BOUNCE,
    DIFFUSE,
    GLOSS,
    HORIZON,
    MIRROR,
    NORMAL,
    SKYLIGHT,
    SUN,
    SUNLIGHT,
    ZENITH,
)
from scenarionet_sim.kernels.cameras.singles import single
from scenarionet_sim.kernels.minmax import larger, smaller


@device_function(forceinline=True, divides_by_zero=True)
def light_vertices(light: Float64, count: int, is_glossy: bool, vertices: Float64, lights: Float32) -> None:
    """Write the light on the first vertices of a mesh in view.

    Args:
        light: Light of the frame.
        count: Number of vertices.
        is_glossy: Whether a material of the mesh mirrors.
        vertices, lights: See ``FrameMemory``.
    """
    nx, ny, nz = vertices[NORMAL], vertices[NORMAL + 1], vertices[NORMAL + 2]
    _light_vertices(count, light, nx, ny, nz, lights[DIFFUSE], lights[DIFFUSE + 1], lights[DIFFUSE + 2])
    if is_glossy:
        _mirror(
            count, light, vertices[AWAY], vertices[AWAY + 1], vertices[AWAY + 2], nx, ny, nz, lights[MIRROR],
            lights[MIRROR + 1], lights[MIRROR + 2], lights[GLOSS], lights[GLOSS + 1], lights[GLOSS + 2],
        )  # fmt: skip


@device_function(divides_by_zero=True, in_lanes=True)
def _light_vertices(
    count: int, light: Float64, nx: Float64, ny: Float64, nz: Float64, red: Float32, green: Float32, blue: Float32
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
        x, y, z = single(nx[k]), single(ny[k]), single(nz[k])
        above, direct = 0.5 + 0.5 * z, larger(x * sx + y * sy + z * sz, 0.0)
        below = 1.0 - above
        red[k] = sun_r * direct + sky_r * above + low_r * below
        green[k] = sun_g * direct + sky_g * above + low_g * below
        blue[k] = sun_b * direct + sky_b * above + low_b * below


@device_function(divides_by_zero=True, in_lanes=True)
def _mirror(
    count: int, light: Float64, away_x: Float64, away_y: Float64, away_z: Float64, nx: Float64, ny: Float64,
    nz: Float64, mirror_r: Float32, mirror_g: Float32, mirror_b: Float32, gloss_r: Float32, gloss_g: Float32,
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
        x, y, z = single(nx[k]), single(ny[k]), single(nz[k])
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
