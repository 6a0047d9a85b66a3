"""Compiled loops that bring states into canonical form."""

from __future__ import annotations

import numpy as np

from scenarionet_data.arrays.dtypes import Array
from scenarionet_data.compiled.decorators import device_function, kernel

_PI = np.pi
_BELOW_PI = np.nextafter(np.float32(np.pi), np.float32(0.0))


@kernel
def fill_poses(
    position: Array, heading: Array, velocity: Array, valid: Array, origin: Array, steps: Array, outs: tuple[Array, ...]
) -> None:
    """Fill positions, headings and velocities in canonical form, at valid states only.

    Args:
        position: (N, T, 3) float64 [m], source frame.
        heading: (N, T) float64 [rad], not necessarily wrapped.
        velocity: (N, T, 2) float64 [m/s].
        valid: (N, T) bool.
        origin: (3,) float64 [m].
        steps: (2,) float32 rounding steps of metres and radians, powers of two.
        outs: The same three as float32; zeros on entry.
    """
    metres, radians = steps[0], steps[1]
    for row in range(valid.shape[0]):
        for step in range(valid.shape[1]):
            if not valid[row, step]:
                continue
            for axis in range(3):
                outs[0][row, step, axis] = _rounded(position[row, step, axis] - origin[axis], metres)
            for axis in range(2):
                outs[2][row, step, axis] = _rounded(velocity[row, step, axis], metres)
            turned = _rounded(_wrapped(heading[row, step]), radians)
            outs[1][row, step] = min(max(turned, -np.float32(_PI)), _BELOW_PI) if turned == turned else turned


@kernel
def fill_sizes(size: Array, valid: Array, metres: np.float32, out: Array) -> None:
    """Fill sizes at valid states: exact for objects of constant size, else rounded.

    Args:
        size: (N, T, 3) float32 [m].
        valid: (N, T) bool.
        metres: Rounding step, a power of two.
        out: (N, T, 3) float32; zeros on entry.
    """
    for row in range(valid.shape[0]):
        first, is_changing = -1, False
        for step in range(valid.shape[1]):
            if valid[row, step]:
                first = step if first < 0 else first
                for axis in range(3):
                    is_changing = is_changing or size[row, step, axis] != size[row, first, axis]
        for step in range(valid.shape[1]):
            if valid[row, step]:
                for axis in range(3):
                    value = size[row, step, axis]
                    out[row, step, axis] = _rounded(value, metres) if is_changing else value


@device_function
def _rounded(value: float, step: np.float32) -> np.float32:
    """Round to a multiple of ``step`` (a power of two), as float32, without negative zeros."""
    return np.float32(np.rint(np.float32(value) * (np.float32(1.0) / step)) * step) + np.float32(0.0)


@device_function
def _wrapped(angle: float) -> float:
    if -_PI <= angle < _PI:
        return angle
    turned: float = angle - 2 * _PI * np.floor((angle + _PI) / (2 * _PI))  # NaN for infinity
    return turned
