"""The light that points of meshes send to the camera."""

from __future__ import annotations

import math

from scenarionet_data.arrays.compiled import device_function
from scenarionet_data.arrays.dtypes import Float64
from scenarionet_sim.kernels.cameras.layout import (
    BODY,
    BOUNCE,
    GLASS,
    METAL,
    SKYLIGHT,
    SUN,
    SUNLIGHT,
)
from scenarionet_sim.kernels.cameras.sky import sky_gradient
from scenarionet_sim.kernels.minmax import larger, smaller


@device_function(forceinline=True, divides_by_zero=True)
def lit(
    light: Float64, material: int, red: float, green: float, blue: float, vertex: Float64
) -> tuple[float, float, float]:
    """Return the light that a corner of a triangle sends to the camera.

    Args:
        light: Light of the frame.
        material: Material.
        red, green, blue: Its linear colour.
        vertex: (12,) see ``FrameMemory.vertices``.
    """
    nx, ny, nz = vertex[3], vertex[4], vertex[5]
    above = 0.5 + 0.5 * nz
    direct = larger(nx * light[SUN] + ny * light[SUN + 1] + nz * light[SUN + 2], 0.0)
    below = 1.0 - above
    red *= light[SUNLIGHT] * direct + light[SKYLIGHT] * above + light[BOUNCE] * below
    green *= light[SUNLIGHT + 1] * direct + light[SKYLIGHT + 1] * above + light[BOUNCE + 1] * below
    blue *= light[SUNLIGHT + 2] * direct + light[SKYLIGHT + 2] * above + light[BOUNCE + 2] * below
    if material in (BODY, GLASS, METAL):
        far = 1.0 / math.sqrt(vertex[6] ** 2 + vertex[7] ** 2 + vertex[8] ** 2 + 1e-9)
        vx, vy, vz = vertex[6] * far, vertex[7] * far, vertex[8] * far
        toward = smaller(larger(-(nx * vx + ny * vy + nz * vz), 0.0), 1.0)
        rest = 1.0 - toward
        share = (0.10 if material == GLASS else 0.045) + 0.7 * rest * rest * rest * rest * rest
        rx, ry, rz = vx + 2.0 * toward * nx, vy + 2.0 * toward * ny, vz + 2.0 * toward * nz
        if rz > 0.0:
            other = sky_gradient(light, rz)
        else:
            other = (0.22 * light[BOUNCE], 0.22 * light[BOUNCE + 1], 0.22 * light[BOUNCE + 2])
        shine = larger(rx * light[SUN] + ry * light[SUN + 1] + rz * light[SUN + 2], 0.0)
        shine *= shine
        shine *= shine
        shine *= shine
        shine *= shine
        shine = 0.35 * shine * shine
        red += share * other[0] + shine * light[SUNLIGHT]
        green += share * other[1] + shine * light[SUNLIGHT + 1]
        blue += share * other[2] + shine * light[SUNLIGHT + 2]
    return red, green, blue
