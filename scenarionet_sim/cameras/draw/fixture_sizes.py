"""Fixtures of a world measured several at once: their size on the screen, and whether they have shadows there."""

from __future__ import annotations

import math

import numpy as np

from scenarionet_data.arrays.dtypes import Float32, Int32
from scenarionet_data.compiled.decorators import device_function
from scenarionet_sim.arrays.minmax import larger, smaller
from scenarionet_sim.cameras.draw import codes
from scenarionet_sim.cameras.draw import columns as at
from scenarionet_sim.cameras.draw.shadows import LEAST_CASTER, LEAST_SHADOW, SHADOW_REACH
from scenarionet_sim.cameras.draw.single_precision import single, singles
from scenarionet_sim.cameras.draw.structures import GROUP, FrameView


@device_function(divides_by_zero=True, in_lanes=True)
def measure_fixtures(count: int, first: int, view: FrameView, fixed: Float32, radii: Float32, shadows: Int32) -> None:
    """Write the radii of fixtures on the screen, and whether their shadows may be seen, see ``instances.casts_shadow``.

    Args:
        count, first: Number of groups of fixtures, and the first one.
        view: The camera.
        fixed: See ``Solids``.
        radii: Output, see ``placement.screen_radius``.
        shadows: Output for pinholes, 1 or 0.
    """
    pose, lens, light, is_pinhole = view.pose, view.lens, view.light, view.lens[at.KIND] == codes.PINHOLE
    fx, fy, most, far_shadow = single(lens[at.FX]), single(lens[at.FY]), single(view.reach), single(SHADOW_REACH)
    side = single(larger(lens[at.CX], view.width - lens[at.CX]))
    rise = single(larger(lens[at.CY], view.height - lens[at.CY]))
    per_side, per_rise = math.sqrt(fx * fx + side * side), math.sqrt(fy * fy + rise * rise)
    rx, ry, rz = singles(pose, at.RIGHT)
    dx, dy, dz = singles(pose, at.DOWN)
    ax, ay, az = singles(pose, at.FORWARD)
    per_sun = single(1.0 / larger(light[at.SUN + 2], 0.2))
    sun_x, sun_y = 0.5 * per_sun * single(light[at.SUN]), 0.5 * per_sun * single(light[at.SUN + 1])
    for group in range(count):
        places, begin = fixed[first + group], group * GROUP
        for lane in range(GROUP):
            k = begin + lane
            long, wide, tall = places[4, lane], places[5, lane], places[6, lane]
            wx, wy = single(places[0, lane] - pose[at.EYE]), single(places[1, lane] - pose[at.EYE + 1])
            foot = single(places[2, lane] - pose[at.EYE + 2])
            radius, wz = 0.5 * math.sqrt(long * long + wide * wide + tall * tall) + 0.1, foot + 0.5 * tall
            x, y, z = rx * wx + ry * wy + rz * wz, dx * wx + dy * wy + dz * wz, ax * wx + ay * wy + az * wz
            far = math.sqrt(wx * wx + wy * wy + wz * wz)
            is_beside = (
                (abs(x) * fx - z * side > radius * per_side)
                | (abs(y) * fy - z * rise > radius * per_rise)
                | (z < -radius)
            )
            is_seen = (far - radius <= most) & (not (is_beside & is_pinhole))
            radii[k] = fx * radius / larger(far, 0.1) if is_seen else -1.0
            sweep = tall * per_sun
            wx, wy, radius = wx - tall * sun_x, wy - tall * sun_y, 0.5 * (sweep + long + wide) + 0.45
            x, y, z = rx * wx + ry * wy + rz * foot, dx * wx + dy * wy + dz * foot, ax * wx + ay * wy + az * foot
            is_beside = (
                (abs(x) * fx - z * side > radius * per_side)
                | (abs(y) * fy - z * rise > radius * per_rise)
                | (z < -radius)
            )
            square, limit = wx * wx + wy * wy, far_shadow + radius
            is_tiny = 2.0 * radius * abs(foot) * fy < LEAST_SHADOW * (square - radius * radius)
            has_shadow = (smaller(long, wide) > LEAST_CASTER) & (square < limit * limit) & (not (is_tiny | is_beside))
            shadows[k] = np.int32(1) if has_shadow else np.int32(0)
