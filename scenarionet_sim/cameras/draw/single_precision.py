"""Numbers of 4 bytes, of which the processor computes twice as many at once as of 8."""

from __future__ import annotations

import numpy as np

from scenarionet_data.arrays.dtypes import Float64
from scenarionet_data.compiled.decorators import device_function


@device_function(forceinline=True)
def single(value: float) -> float:
    """Return a number as float32."""
    return np.float32(value)  # type: ignore[return-value]  # compiled functions calculate with it as with a float


@device_function(forceinline=True)
def singles(values: Float64, first: int) -> tuple[float, float, float]:
    """Return three neighbouring numbers as float32."""
    return single(values[first]), single(values[first + 1]), single(values[first + 2])


@device_function(forceinline=True)
def single_of(number: int) -> float:
    """Return a whole number of at most 32 bits as float32: of those the processor converts as many at once."""
    return np.float32(np.int32(number))  # type: ignore[return-value]


@device_function(forceinline=True)
def bits_of(value: float) -> int:
    """Return the bits of a float32 as an int32."""
    return np.float32(value).view(np.int32)  # type: ignore[return-value]


@device_function(forceinline=True)
def rounded_down(value: float) -> float:
    """Return the largest whole number that is not larger, as a number of the same type."""
    return np.floor(value)  # type: ignore[no-any-return]


@device_function(forceinline=True)
def number_of(bits: int) -> float:
    """Return the float32 that has the bits of an int32."""
    return np.int32(bits).view(np.float32)  # type: ignore[return-value]
