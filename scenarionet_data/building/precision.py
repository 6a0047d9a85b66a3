"""Rounding of a scenario's numbers, and the origin of its coordinates."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from scenarionet_data.arrays.dtypes import Array, Bool, Float32, Float64

METRES = 2.0**-14
"""Rounding step of positions and speeds: 0.06 mm, the resolution of float32 at 500 m from the origin."""

WIDTHS = 2.0**-10
"""Rounding step of lane widths given per point: 1 mm."""

RADIANS = 2.0**-20
"""Rounding step of headings: 1e-6 rad."""


def rounded(values: npt.ArrayLike, step: float) -> Float32:
    """Round to multiples of ``step``, as float32.

    Digits below the precision of any sensor would take up a fifth of the lake.
    """
    with np.errstate(over="ignore"):  # overflow becomes infinity, which validation reports
        array = np.array(values, dtype=np.float32)
        array *= np.float32(1.0 / step)  # a power of two: exact
        np.rint(array, out=array)
        array *= np.float32(step)
    return array


def make_origin(position: Array, valid: Bool, has_z: bool) -> Float64:
    """Return the origin of a scenario: the ego's first valid position rounded to whole metres.

    Args:
        position: (T, 3) ego positions in the source frame [m].
        valid: (T,).
        has_z: If False, the origin's z is 0.

    Returns:
        (3,) float64 [m].
    """
    first = np.round(np.asarray(position, dtype=np.float64)[int(np.argmax(valid))])
    return np.array([first[0], first[1], first[2] if has_z else 0.0], dtype=np.float64) + 0.0


def offsets_from(origin: Float64, points: Array) -> Float32:
    """Return points (..., 3) as float32 offsets, subtracted in float64 without a float64 copy."""
    offsets = np.empty(points.shape, np.float32)
    with np.errstate(over="ignore"):  # overflow becomes infinity, which validation reports
        np.subtract(points, origin, out=offsets, casting="same_kind")
    return offsets
