"""How finely a scenario's numbers are kept, and the origin they are kept from."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from scenarionet_data.arrays.dtypes import Array, Bool, Float32, Float64

METRES = 2.0**-14
"""Positions and speeds are multiples of this: 0.06 mm, what float32 resolves half a kilometre from the origin."""

WIDTHS = 2.0**-10
"""Lane widths given point by point are multiples of this: 1 mm."""

RADIANS = 2.0**-20
"""Headings are multiples of this: a millionth of a radian."""


def rounded(values: npt.ArrayLike, step: float) -> Float32:
    """Values to the nearest multiple of ``step``, as float32.

    A recorder's noise below that would fill a fifth of the lake with digits nobody measured.
    """
    with np.errstate(over="ignore"):  # beyond float32 becomes infinite, which validation names
        array = np.array(values, dtype=np.float32)
        array *= np.float32(1.0 / step)  # a power of two: exact
        np.rint(array, out=array)
        array *= np.float32(step)
    return array


def make_origin(position: Array, valid: Bool, has_z: bool) -> Float64:
    """Origin of a scenario: the ego's first valid position rounded to whole metres.

    Args:
        position: (T, 3) of the ego in the source frame [m].
        valid: (T,).
        has_z: Without heights the origin's z is 0.

    Returns:
        (3,) float64 [m].
    """
    first = np.round(np.asarray(position, dtype=np.float64)[int(np.argmax(valid))])
    return np.array([first[0], first[1], first[2] if has_z else 0.0], dtype=np.float64) + 0.0


def offsets_from(origin: Float64, points: Array) -> Float32:
    """Points (..., 3) as float32 offsets, subtracted in float64 without a float64 copy of all of them."""
    offsets = np.empty(points.shape, np.float32)
    with np.errstate(over="ignore"):  # beyond float32 becomes infinite, which validation names
        np.subtract(points, origin, out=offsets, casting="same_kind")
    return offsets
