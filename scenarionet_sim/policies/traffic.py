"""The policies of objects as arrays, for the compiled step."""

from __future__ import annotations

from typing import NamedTuple

from scenarionet_data.arrays.dtypes import Float64, UInt8


class Traffic(NamedTuple):
    """Policies of P numbers.

    Attributes:
        driver: (W, N) policy of each object, or ``UNDRIVEN``.
        movement: (P,) see ``policies.motion_kernels.REPLAY``.
        law: (W, P, 8) numbers of a ``Law``.
        colors: (K,) ``LightColor`` by ``LightState``.
    """

    driver: UInt8
    movement: UInt8
    law: Float64
    colors: UInt8
