"""Projection through lenses; the inverse is a table of rays, see ``cameras.lenses``."""

from __future__ import annotations

import math

from scenarionet_data.arrays.dtypes import Float64
from scenarionet_data.compiled.decorators import device_function
from scenarionet_sim.cameras.draw import codes
from scenarionet_sim.cameras.draw import columns as at


@device_function(divides_by_zero=True)
def project(lens: Float64, x: float, y: float, z: float) -> tuple[float, float]:
    """Return column and row of a point right, below and ahead of the camera.

    Pinhole and distortion (Brown, Conrady) as in OpenCV's ``projectPoints``; fisheye (Kannala, Brandt) as in OpenCV's
    ``fisheye.projectPoints``. Points behind a pinhole have no meaningful result.
    """
    kind = lens[at.KIND]
    if kind == codes.FISHEYE:
        flat = math.sqrt(x * x + y * y)
        angle = math.atan2(flat, z)
        square = angle * angle
        bent = angle * (
            1.0 + square * (lens[at.K1] + square * (lens[at.K2] + square * (lens[at.P1] + square * lens[at.P2])))
        )
        scale = bent / flat if flat > 1e-12 else 1.0
        return lens[at.FX] * x * scale + lens[at.CX], lens[at.FY] * y * scale + lens[at.CY]
    u, v = x / z, y / z
    if kind == codes.DISTORTED:
        square = u * u + v * v
        radial = 1.0 + square * (lens[at.K1] + square * (lens[at.K2] + square * lens[at.K3]))
        moved = u * radial + 2.0 * lens[at.P1] * u * v + lens[at.P2] * (square + 2.0 * u * u)
        v = v * radial + lens[at.P1] * (square + 2.0 * v * v) + 2.0 * lens[at.P2] * u * v
        u = moved
    return lens[at.FX] * u + lens[at.CX], lens[at.FY] * v + lens[at.CY]
