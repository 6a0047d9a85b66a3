"""Minimum and maximum of two numbers for compiled functions.

Numba compiles the builtins ``min`` and ``max`` again for every call site (20 ms each), but these functions once.
"""

from __future__ import annotations

from typing import TypeVar

from scenarionet_data.compiled.decorators import device_function

Number = TypeVar("Number", int, float)


@device_function
def smaller(a: Number, b: Number) -> Number:
    """Return the smaller of two numbers."""
    return a if a < b else b


@device_function
def larger(a: Number, b: Number) -> Number:
    """Return the larger of two numbers."""
    return a if a > b else b
