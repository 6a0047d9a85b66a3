"""Savitzky-Golay filter: smoothing and derivatives by polynomial fits to moving windows.

A. Savitzky and M. J. E. Golay, Analytical Chemistry 36 (1964) 1627. Ends and even windows are treated as in
``scipy.signal.savgol_filter`` with its default mode "interp", which nuPlan's metrics use: the first and last half
window use the polynomial of the first and last full window, and the output of an even window is shifted by half a
sample.
"""

from __future__ import annotations

import math
from functools import cache

import numpy as np

from scenarionet_data.arrays.dtypes import Float64


def savitzky_golay(values: Float64, window: int, order: int, dt: float, derivative: int = 0) -> Float64:
    """Return the smoothed series or a derivative of it.

    Args:
        values: (..., T).
        window: Window length [samples], at most T.
        order: Order of the polynomials.
        dt: Sampling interval [s].
        derivative: Order of the derivative; 0 for the series itself.

    Returns:
        (..., T); NaN if there are at most ``order`` samples.

    Example:
        >>> savitzky_golay(np.array([0.0, 1.0, 4.0, 9.0, 16.0]), 5, 2, dt=1.0, derivative=1).round(6).tolist()
        [0.0, 2.0, 4.0, 6.0, 8.0]
    """
    count = values.shape[-1]
    window = min(window, count)
    if window <= order:
        return np.full(values.shape, np.nan)
    half, middle = window // 2, (window - 1) / 2
    fit = _fit(window, order)
    scale = math.factorial(derivative) / dt**derivative
    polynomials = np.lib.stride_tricks.sliding_window_view(values, window, axis=-1) @ fit.T
    smooth = np.empty(values.shape)
    first = math.floor(middle)
    smooth[..., first : first + polynomials.shape[-2]] = polynomials[..., derivative] * scale
    ends = np.arange(half, dtype=np.float64) - middle
    smooth[..., :half] = _evaluate(polynomials[..., 0, :], ends, derivative) / dt**derivative
    last = polynomials[..., -1, :]
    smooth[..., count - half :] = _evaluate(last, ends + (window - half), derivative) / dt**derivative
    return smooth


@cache
def _fit(window: int, order: int) -> Float64:
    """Matrix (order + 1, window) from the samples of a window to the coefficients of their polynomial."""
    fit: Float64 = np.linalg.pinv(np.vander(np.arange(window) - (window - 1) / 2, order + 1, increasing=True))
    return fit


def _evaluate(polynomials: Float64, at: Float64, derivative: int) -> Float64:
    """Values (..., K) of a derivative of polynomials (..., C), whose coefficients rise in degree, by Horner's rule."""
    coefficients = polynomials
    for _ in range(derivative):
        coefficients = (np.arange(coefficients.shape[-1]) * coefficients)[..., 1:]
    found = np.broadcast_to(coefficients[..., -1:], (*polynomials.shape[:-1], len(at)))
    for power in reversed(range(coefficients.shape[-1] - 1)):
        found = coefficients[..., power, None] + found * at
    return found
