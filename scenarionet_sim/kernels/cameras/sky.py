"""The sky: a gradient, the sun's glow and clouds."""

from __future__ import annotations

import math

from scenarionet_data.arrays.compiled import device_function
from scenarionet_data.arrays.dtypes import Float64, UInt8
from scenarionet_sim.kernels.cameras.layout import CLOUD, HORIZON, SHIFT, SKYLIGHT, SUN, SUNLIGHT, ZENITH
from scenarionet_sim.kernels.minmax import larger, smaller

GRAIN_SIZE = 512
"""Side of the tables of noise [texels]; a power of two."""


@device_function(forceinline=True, divides_by_zero=True)
def smooth_noise(grain: UInt8, x: float, y: float) -> float:
    """Return coarse noise in [0, 1] at a place [texels], interpolated."""
    column, row = math.floor(x), math.floor(y)
    u, v = x - column, y - row
    i, j = int(column) & (GRAIN_SIZE - 1), int(row) & (GRAIN_SIZE - 1)
    k, m = (i + 1) & (GRAIN_SIZE - 1), (j + 1) & (GRAIN_SIZE - 1)
    above = grain[1, j, i] * (1.0 - u) + grain[1, j, k] * u
    below = grain[1, m, i] * (1.0 - u) + grain[1, m, k] * u
    return float(above * (1.0 - v) + below * v) * (1.0 / 255.0)


@device_function(forceinline=True, divides_by_zero=True)
def sky_gradient(light: Float64, z: float) -> tuple[float, float, float]:
    """Return the linear RGB of the clear sky in directions that rise by ``z`` (of a unit vector)."""
    share = math.sqrt(larger(z, 0.0))
    share = share * (1.6 - 0.6 * share)
    return (
        light[HORIZON] + (light[ZENITH] - light[HORIZON]) * share,
        light[HORIZON + 1] + (light[ZENITH + 1] - light[HORIZON + 1]) * share,
        light[HORIZON + 2] + (light[ZENITH + 2] - light[HORIZON + 2]) * share,
    )


@device_function(forceinline=True, divides_by_zero=True)
def sky_color(light: Float64, grain: UInt8, x: float, y: float, z: float) -> tuple[float, float, float]:
    """Return the linear RGB of the sky with sun and clouds in a direction (unit vector)."""
    red, green, blue = sky_gradient(light, z)
    toward = larger(x * light[SUN] + y * light[SUN + 1] + z * light[SUN + 2], 0.0)
    glow = toward * toward
    glow *= glow
    wide = 0.10 * glow
    glow *= glow
    glow *= glow
    glow *= glow
    shine = wide + 0.25 * glow * glow + (3.0 if toward > 0.99985 else 0.0)
    red, green, blue = (
        red + shine * light[SUNLIGHT],
        green + shine * light[SUNLIGHT + 1],
        blue + shine * light[SUNLIGHT + 2],
    )
    if z > 0.02 and light[CLOUD] > 0.0:
        scale = 26.0 / (z + 0.12)
        u, v = x * scale + light[SHIFT], y * scale + 0.7 * light[SHIFT]
        thick = 0.62 * smooth_noise(grain, u, v) + 0.38 * smooth_noise(grain, 2.7 * u + 90.0, 2.7 * v + 31.0)
        cover = smaller(larger((thick - 1.0 + light[CLOUD]) * 3.2, 0.0), 1.0) * smaller((z - 0.02) * 7.0, 1.0)
        bright = 0.75 + 0.5 * (1.0 - thick)
        red += cover * (bright * (0.8 * light[SKYLIGHT] + 0.22 * light[SUNLIGHT]) - red)
        green += cover * (bright * (0.8 * light[SKYLIGHT + 1] + 0.22 * light[SUNLIGHT + 1]) - green)
        blue += cover * (bright * (0.8 * light[SKYLIGHT + 2] + 0.22 * light[SUNLIGHT + 2]) - blue)
    return red, green, blue
